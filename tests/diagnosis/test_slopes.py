"""Slopes by differences: right where laws bend, and asked for once where they do not."""

import numpy as np
import pytest

from mbexport.core.diagnosis.slopes import Sloped, differences

RANDOM = np.random.default_rng(6)
MATRIX = RANDOM.normal(size=(30, 4))
HIGH = np.array([np.inf, 1.0, np.inf, np.inf])


class Counted:
    """A function that counts how often it is asked."""

    def __init__(self, of):
        self.of, self.times = of, 0

    def __call__(self, x):
        self.times += 1
        return self.of(x)


def test_slopes_are_those_of_the_function_up_to_where_numbers_end():
    x = np.array([0.7, 1.0, 0.0, -3.0])
    tried = []
    slopes = differences(lambda there: (tried.append(there), np.sin(MATRIX @ there))[1], x, HIGH)
    np.testing.assert_allclose(slopes, np.cos(MATRIX @ x)[:, None] * MATRIX, atol=5e-2)
    assert max(there[1] for there in tried) <= 1.0


def test_a_straight_law_is_asked_for_its_slopes_once():
    law = Counted(lambda x: MATRIX @ x - 1.0)
    function = Sloped(law, HIGH)
    first = function.slopes(np.ones(4))
    asked = law.times
    assert asked == 1 + 4
    again = function.slopes(np.array([2.0, 0.5, -1.0, 3.0]))
    np.testing.assert_allclose(first, MATRIX, atol=1e-9)
    assert again is first
    # where it is, and nothing beside that
    assert law.times == asked + 1


@pytest.mark.parametrize("bend", [0.5, 3.0])
def test_a_bent_one_is_asked_again_where_its_slopes_have_changed(bend):
    function = Sloped(lambda x: np.sin(bend * MATRIX @ x), HIGH)
    first = function.slopes(np.zeros(4))
    x = np.array([0.4, -0.3, 0.2, 0.5])
    assert function.slopes(1e-6 * x) is first
    np.testing.assert_allclose(
        function.slopes(x), bend * np.cos(bend * MATRIX @ x)[:, None] * MATRIX, atol=2e-2 * bend**2
    )


def test_values_are_asked_for_once():
    law = Counted(lambda x: MATRIX @ x)
    function = Sloped(law, HIGH)
    np.testing.assert_array_equal(function.at(np.ones(4)), MATRIX @ np.ones(4))
    function.at(np.ones(4))
    assert law.times == 1


def test_of_no_numbers_there_are_no_slopes():
    assert differences(lambda x: np.ones(3), np.zeros(0), np.zeros(0)).shape == (3, 0)
