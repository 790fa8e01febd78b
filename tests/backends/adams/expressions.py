"""Function expressions of Adams, from its documentation: numbers, operators, functions, IF(test: lt, eq, gt).

An expression becomes a function of a `Scope`, which knows markers, splines and variables by the file's names.
"""

from __future__ import annotations

import math
import operator
import re

TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+\.?\d*|\.\d+)(?:[EeDd][-+]?\d+)?)(?P<degrees>[Dd](?![A-Za-z0-9_]))?"
    r"|(?P<name>\.?[A-Za-z_][\w.]*)|(?P<sign>\*\*|[-+*/(),:]))"
)
MATH = {
    "SIN": math.sin, "COS": math.cos, "TAN": math.tan, "ASIN": math.asin, "ACOS": math.acos, "ATAN": math.atan,
    "ATAN2": math.atan2, "SINH": math.sinh, "COSH": math.cosh, "TANH": math.tanh, "EXP": math.exp, "LOG": math.log,
    "LOG10": math.log10, "SQRT": math.sqrt, "ABS": abs, "MAX": max, "MIN": min, "SIGN": math.copysign,
}  # fmt: skip
# functions of the model's state, whose arguments are names or numbers of things
STATE = {
    "AZ",
    "WZ",
    "WDTZ",
    "DX",
    "DY",
    "DZ",
    "VZ",
    "ACCZ",
    "PSI",
    "THETA",
    "PHI",
    "VARVAL",
    "MOTION",
    "CUBSPL",
    "AKISPL",
    "DELAY",
}
ACCELERATIONS = {"WDTZ", "ACCZ"}


def tokens(text):
    out, at = [], 0
    text = text.strip()
    while at < len(text):
        match = TOKEN.match(text, at)
        assert match, f"cannot read {text[at : at + 20]!r} in {text!r}"
        out.append(match)
        at = match.end()
    return out


def joined(function, left, right):
    return lambda s: function(left(s), right(s))


class Expression:
    """A parsed expression; call it with a scope."""

    def __init__(self, text):
        self.text = text
        self._tokens, self._at = tokens(text), 0
        self.names = set()
        self._tree = self._sum()
        assert self._at == len(self._tokens), f"left over in {text!r}"

    def __call__(self, scope):
        return self._tree(scope)

    @property
    def accelerated(self):
        return bool(self.names & ACCELERATIONS)

    def _peek(self):
        return self._tokens[self._at].group().strip() if self._at < len(self._tokens) else ""

    def _take(self, wanted=None):
        token = self._tokens[self._at]
        assert wanted is None or token.group().strip() == wanted, f"{wanted!r} wanted in {self.text!r}"
        self._at += 1
        return token

    def _sum(self):
        return self._chain({"+": operator.add, "-": operator.sub}, self._product)

    def _product(self):
        return self._chain({"*": operator.mul, "/": operator.truediv}, self._signed)

    def _chain(self, signs, part):
        left = part()
        while self._peek() in signs:
            left = joined(signs[self._take().group().strip()], left, part())
        return left

    def _signed(self):
        if self._peek() in ("-", "+"):
            sign, value = self._take().group().strip(), self._signed()
            return (lambda s: -value(s)) if sign == "-" else value
        return self._power()

    def _power(self):
        base = self._atom()
        if self._peek() == "**":
            self._take()
            power = self._signed()
            return lambda s: base(s) ** power(s)
        return base

    def _atom(self):
        token = self._take()
        if token["number"]:
            value = float(token["number"].upper().replace("D", "E"))
            value = math.radians(value) if token["degrees"] else value
            return lambda s: value
        if token["sign"] == "(":
            inner = self._sum()
            self._take(")")
            return inner
        name = token["name"]
        assert name, f"{token.group()!r} out of place in {self.text!r}"
        upper = name.upper()
        if self._peek() != "(":
            if upper == "TIME":
                return lambda s: s.time
            assert upper == "PI", f"unknown name {name!r}"
            return lambda s: math.pi
        self.names.add(upper)
        if upper == "IF":
            return self._if()
        if upper in STATE:
            return self._state(upper)
        assert upper in MATH, f"unknown function {name!r}"
        arguments, function = self._arguments(), MATH[upper]
        return lambda s: function(*(argument(s) for argument in arguments))

    def _arguments(self):
        self._take("(")
        out = [self._sum()]
        while self._peek() == ",":
            self._take()
            out.append(self._sum())
        self._take(")")
        return out

    def _if(self):
        self._take("(")
        test = self._sum()
        self._take(":")
        below = self._sum()
        self._take(",")
        equal = self._sum()
        self._take(",")
        above = self._sum()
        self._take(")")

        def value(s):
            x = test(s)
            return below(s) if x < 0.0 else equal(s) if x == 0.0 else above(s)

        return value

    def _state(self, name):
        """Arguments are expressions (of splines and delays), or what they name."""
        self._take("(")
        arguments = []
        while True:
            token = self._tokens[self._at]
            named = name not in ("CUBSPL", "AKISPL", "DELAY") or (name != "DELAY" and len(arguments) == 2)
            if named:
                arguments.append(self._take()["name"] or token["number"])
            else:
                arguments.append(self._sum())
            if self._peek() == ")":
                self._take()
                break
            self._take(",")
        return lambda s: s.function(name, arguments)
