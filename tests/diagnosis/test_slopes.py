"""Slopes by differences: right where laws bend, and asked for once where they do not."""

import numpy as np

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


def test_of_one_that_bends_much_they_are_taken_anew():
    function = Sloped(lambda x: np.sin(3.0 * MATRIX @ x), HIGH)
    first = function.slopes(np.zeros(4))
    x = np.array([0.4, -0.3, 0.2, 0.5])
    assert function.slopes(1e-6 * x) is first
    np.testing.assert_allclose(function.slopes(x), 3.0 * np.cos(3.0 * MATRIX @ x)[:, None] * MATRIX, atol=0.2)


def test_of_one_that_bends_a_little_they_are_turned_to_what_the_step_changed_and_taken_anew_at_the_end():
    law = Counted(lambda x: np.sin(0.5 * MATRIX @ x))
    function = Sloped(law, HIGH)
    first = function.slopes(np.zeros(4))
    x = np.array([0.4, -0.3, 0.2, 0.5])
    asked = law.times
    turned = function.slopes(x)
    assert law.times == asked + 1
    np.testing.assert_allclose(turned @ x, law.of(x) - law.of(np.zeros(4)), atol=1e-12)
    # across the step nothing is known
    aside = np.array([0.3, 0.4, 0.0, 0.0])
    np.testing.assert_allclose(turned @ aside, first @ aside, atol=1e-12)
    function.settle(x)
    np.testing.assert_allclose(function.slopes(x), 0.5 * np.cos(0.5 * MATRIX @ x)[:, None] * MATRIX, atol=5e-3)
    asked = law.times
    function.settle(x)
    assert law.times == asked


def test_they_are_turned_no_more_often_than_there_are_numbers():
    law = Counted(lambda x: np.exp(0.3 * MATRIX @ x))
    function = Sloped(law, HIGH)
    function.slopes(np.zeros(4))
    asked = law.times
    for k in range(5):
        function.slopes(0.2 * (k + 1) * np.eye(4)[k % 4])
    assert law.times == asked + 5 + 4


def test_values_are_asked_for_once():
    law = Counted(lambda x: MATRIX @ x)
    function = Sloped(law, HIGH)
    np.testing.assert_array_equal(function.at(np.ones(4)), MATRIX @ np.ones(4))
    function.at(np.ones(4))
    assert law.times == 1


def test_of_no_numbers_there_are_no_slopes():
    assert differences(lambda x: np.ones(3), np.zeros(0), np.zeros(0)).shape == (3, 0)
