"""Laws of effects as expressions: the same numbers as the laws give, and None for what has no expression."""

import ast
import math

import numpy as np
import pytest

from mbexport.backends.law_expression import Dialect, law_expression
from mbexport.core.effects import catalogue, effect_named
from mbexport.core.effects.effect import Law

NAMES = ("t", "theta", "dtheta", "q", "dq", "load")
MATH = ("sin", "cos", "exp", "tanh", "sqrt", "log", "atan2")
PYTHON = Dialect("**", {name: name for name in MATH} | {"abs": "abs", "max": "max", "min": "min"})
LAWS = [(name, law.name) for name in catalogue() for law in effect_named(name).laws]


def evaluate(text, values):
    return eval(text, {name: getattr(math, name) for name in MATH} | {"abs": abs, "max": max, "min": min}, values)


@pytest.mark.parametrize(("effect", "law"), LAWS)
def test_every_law_of_the_catalogue_has_an_expression(effect, law):
    function = next(item.function for item in effect_named(effect).laws if item.name == law)
    rng = np.random.default_rng(3)
    for _ in range(5):
        parameters = rng.uniform(0.1, 2.0, 8).tolist()
        values = dict(zip(NAMES, rng.uniform(-2.0, 2.0, 6).tolist(), strict=True))
        text = law_expression(effect, law, parameters, {name: name for name in NAMES}, PYTHON)
        assert text is not None
        assert evaluate(text, values) == pytest.approx(function(parameters, *values.values()), rel=1e-15)


def other_names(a, now, x, dx, y, dy, force):
    """Arguments go by their places."""
    share = a[0] * math.pi
    share = share - dx**2
    return max(share, -1.0e-7) / abs(force)


def branches(p, t, theta, dtheta, q, dq, load):
    if theta > 0.0:
        return p[0]
    return 0.0


def loops(p, t, theta, dtheta, q, dq, load):
    total = 0.0
    for _ in range(3):
        total += p[0]
    return total


def unknown(p, t, theta, dtheta, q, dq, load):
    return math.gamma(theta)


def too_many(p, t, theta, dtheta, q, dq, load):
    return p[9]


@pytest.fixture
def as_law(monkeypatch):
    """Text of a plain function as if it were a law."""

    def make(function, values=NAMES, dialect=PYTHON, parameters=(2.0,)):
        from mbexport.backends import law_expression as module

        law = Law("resistance", function)
        monkeypatch.setattr(module, "law_function", lambda effect, name: law.function)
        return law_expression("effect", function.__name__, parameters, {name: name for name in values}, dialect)

    return make


def test_arguments_go_by_place_and_names_stand_for_their_texts(as_law):
    text = as_law(other_names)
    assert text is not None
    assert ast.parse(text, mode="eval")
    values = dict(zip(NAMES, (0.0, 0.0, 0.3, 0.0, 0.0, -4.0), strict=True))
    assert evaluate(text, values) == other_names((2.0,), *values.values())


@pytest.mark.parametrize("function", [branches, loops, unknown, too_many])
def test_what_is_no_expression_is_not_said(as_law, function):
    assert as_law(function) is None


def test_what_is_not_there_is_not_used(as_law):
    assert as_law(other_names, values=("t", "theta", "dtheta", "q", "dq")) is None


def test_a_lambda_has_no_text_of_its_own(as_law):
    assert as_law(lambda p, t, theta, dtheta, q, dq, load: p[0]) is None


@pytest.mark.parametrize(
    ("value", "text"),
    [(1.0, "1.0"), (-2.5, "(-2.5)"), (1e-7, "1.0E-07"), (1e30, "1.0E+30"), (0.1 + 0.2, "0.30000000000000004")],
)
def test_numbers_keep_their_digits_and_have_a_point(value, text):
    assert PYTHON.number(value) == text
    assert float(text.strip("()")) == value
