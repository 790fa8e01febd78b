"""A law of an effect as one expression of another language, read from the law's own text.

Laws are plain functions of numbers: assignments and a return, with arithmetic and the module `math`. What goes beyond
that (branches, loops) has no expression, and a format that knows expressions only cannot say it.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from ..core.rendering import number
from ..core.simulation.compiled import law_function

_OPERATORS: Mapping[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
_CONSTANTS = {"pi": math.pi, "e": math.e, "tau": math.tau}


@dataclass(frozen=True, slots=True)
class Dialect:
    """How a language writes expressions.

    Attributes:
        power: Its operator.
        functions: Its names of Python's functions ("exp", "abs", ...); what is missing it cannot say.
    """

    power: str
    functions: Mapping[str, str]

    def number(self, value: float) -> str:
        """A number with all its digits and a point, a negative one in brackets."""
        mantissa, exponent, power = number(value).partition("e")
        text = mantissa + ("" if "." in mantissa else ".0") + exponent.upper() + power
        return f"({text})" if text.startswith("-") else text


class _UnsaidError(Exception):
    """Something in a law has no word in the dialect."""


def law_expression(
    effect: str, law: str, parameters: Sequence[float], values: Mapping[str, str], dialect: Dialect
) -> str | None:
    """One law as an expression, with its parameters as numbers; None where the dialect cannot say it.

    Args:
        effect: Name of the effect.
        law: Name of the law within it.
        parameters: Values of the term.
        values: Text of what the law may use: "t", "theta", "dtheta", "q", "dq", "load"; what is missing is not there
            for the expression to use.
        dialect: How to write it.
    """
    function = law_function(effect, law)
    try:
        text = textwrap.dedent(inspect.getsource(function))
        definition = ast.parse(text).body[0]
        if not isinstance(definition, ast.FunctionDef):
            return None
        known = dict(zip((argument.arg for argument in definition.args.args), ("p", *_ARGUMENTS), strict=True))
        return _Writer(parameters, known, values, dialect).body(definition)
    except (_UnsaidError, OSError, TypeError, SyntaxError, ValueError, IndexError):
        return None


_ARGUMENTS = ("t", "theta", "dtheta", "q", "dq", "load")


class _Writer:
    """Writes one law; names stand for the texts assigned to them."""

    def __init__(
        self, parameters: Sequence[float], known: Mapping[str, str], values: Mapping[str, str], dialect: Dialect
    ) -> None:
        self.parameters = parameters
        self.dialect = dialect
        # the law may call its arguments as it likes, their order is the contract
        self.table = next(name for name, meaning in known.items() if meaning == "p")
        self.names = {name: values[meaning] for name, meaning in known.items() if meaning in values}

    def body(self, definition: ast.FunctionDef) -> str:
        for statement in definition.body:
            match statement:
                case ast.Expr(value=ast.Constant()):
                    continue
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    self.names[name] = self.text(value)
                case ast.Return(value=ast.expr() as value):
                    return self.text(value)
                case _:
                    raise _UnsaidError
        raise _UnsaidError

    def text(self, node: ast.expr) -> str:
        match node:
            case ast.Constant(value=bool()):
                raise _UnsaidError
            case ast.Constant(value=int() | float() as value):
                return self.dialect.number(value)
            case ast.Name(id=name) if name in self.names:
                return self.names[name]
            case ast.Subscript(value=ast.Name(id=name), slice=ast.Constant(value=int() as index)) if name == self.table:
                return self.dialect.number(self.parameters[index])
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in _CONSTANTS:
                return self.dialect.number(_CONSTANTS[name])
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                return f"(-{self.text(operand)})"
            case ast.BinOp(left=left, op=ast.Pow(), right=right):
                return f"({self.text(left)}{self.dialect.power}{self.text(right)})"
            case ast.BinOp(left=left, op=operator, right=right) if type(operator) in _OPERATORS:
                return f"({self.text(left)} {_OPERATORS[type(operator)]} {self.text(right)})"
            case ast.Call(func=function, args=arguments, keywords=[]):
                return f"{self._function(function)}({','.join(self.text(argument) for argument in arguments)})"
            case _:
                raise _UnsaidError

    def _function(self, node: ast.expr) -> str:
        match node:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) | ast.Name(id=name):
                if name in self.dialect.functions:
                    return self.dialect.functions[name]
            case _:
                pass
        raise _UnsaidError
