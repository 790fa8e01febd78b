"""Plain Python numerics as C, so that a law or an equation is written once and runs in both.

What is understood is what Numba compiles of our texts and little more: functions of numbers and of arrays whose shapes
are stated beside them; assignments, `if`, `for ... in range(...)`, `while`, arithmetic, comparisons and the module
`math`. Anything else is an `UntranslatableError` that says what it is and in which line, never a guess.

Sizes of arrays are names of macros, or numbers; a row of an array is a pointer; a table of arrays (a named tuple in
Python) is a struct, handed over by its address.
"""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from ..core.rendering import number

_FUNCTIONS = {
    name: name
    for name in (
        *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
        *("exp", "expm1", "log", "log1p", "log2", "log10", "sqrt", "pow", "floor", "ceil", "hypot", "copysign", "fabs"),
        *("erf", "erfc", "trunc", "fmod", "isfinite", "isnan", "isinf"),
    )
}
_CONSTANTS = {"pi": math.pi, "e": math.e, "tau": math.tau}
_WHOLE = ("floor", "ceil", "trunc")  # whole numbers in Python
_TRUTHS = ("isfinite", "isnan", "isinf")
_OPERATORS: Mapping[type[ast.operator], str] = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*"}
_COMPARISONS: Mapping[type[ast.cmpop], str] = {
    ast.Eq: "==",
    ast.NotEq: "!=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
}


class UntranslatableError(Exception):
    """Something in a text has no form in C here."""


@dataclass(frozen=True, slots=True)
class CType:
    """Type of a value.

    Attributes:
        base: "double", "int", the name of a struct or of a type of functions.
        shape: Sizes of an array, outermost first, as C text; () is a single value.
        struct: The value is the address of a struct.
    """

    base: str
    shape: tuple[str, ...] = ()
    struct: bool = False

    def declared(self, name: str) -> str:
        """Declaration of an array that is there, or of a single value."""
        return f"{self.base} {'*' if self.struct else ''}{name}{''.join(f'[{size}]' for size in self.shape)}"

    def pointer(self, name: str) -> str:
        """Declaration of a pointer to what stands elsewhere."""
        if len(self.shape) < 2:
            return f"{self.base} *{name}"
        return f"{self.base} (*{name}){''.join(f'[{size}]' for size in self.shape[1:])}"


DOUBLE = CType("double")
INT = CType("int")
Struct = Mapping[str, CType]


def array(*shape: str, base: str = "double") -> CType:
    """An array of a shape."""
    return CType(base, shape)


@dataclass(frozen=True, slots=True)
class Signature:
    """A function as C sees it.

    Attributes:
        name: In C.
        arguments: Types by the Python text's own names, in its order.
        returns: DOUBLE, or None.
    """

    name: str
    arguments: Mapping[str, CType]
    returns: CType | None = None

    def head(self) -> str:
        """The function's declaration without its end."""
        parts = [kind.declared(name) for name, kind in self.arguments.items()]
        return f"static {self.returns.base if self.returns else 'void'} {self.name}({', '.join(parts)})"


def c_function(
    function: Callable[..., Any],
    signature: Signature,
    structs: Mapping[str, Struct] | None = None,
    known: Mapping[str, Signature] | None = None,
) -> str:
    """The text of a Python function as a C function.

    Args:
        function: Its text must be readable.
        signature: Its types.
        structs: Fields of the structs it gets.
        known: Python names of the functions it may call.

    Raises:
        UntranslatableError: Something in it has no form in C.
    """
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
    except (OSError, TypeError, SyntaxError, IndexError) as error:
        raise UntranslatableError("its text cannot be read") from error
    if not isinstance(tree, ast.FunctionDef):
        raise UntranslatableError("it is no plain function")
    names = [argument.arg for argument in tree.args.args]
    if len(names) != len(signature.arguments):
        raise UntranslatableError(f"it takes {len(names)} arguments instead of {len(signature.arguments)}")
    # a law may call its arguments as it likes, their order is the contract
    types = dict(zip(names, signature.arguments.values(), strict=True))
    scope = dict(inspect.getclosurevars(function).globals) if callable(function) else {}
    writer = _Writer(types, signature.returns, scope, structs or {}, known or {})
    body = writer.block(tree.body, 1)
    head = Signature(signature.name, types, signature.returns).head()
    local = [f"    {text};" for text in writer.declarations()]
    return "\n".join([f"{head}\n{{", *local, *body, "}"]) + "\n"


@dataclass(slots=True)
class _Writer:
    """Writes one function; the types of its locals are found on the way."""

    arguments: Mapping[str, CType]
    returns: CType | None
    scope: Mapping[str, Any]
    structs: Mapping[str, Struct]
    known: Mapping[str, Signature]
    locals: dict[str, CType] = field(default_factory=dict[str, CType])
    arrays: set[str] = field(default_factory=set[str])
    sizes: dict[str, str] = field(default_factory=dict[str, str])

    # statements

    def declarations(self) -> list[str]:
        """The locals, all at the head."""
        return [
            kind.declared(name) if name in self.arrays or not kind.shape else kind.pointer(name)
            for name, kind in self.locals.items()
        ]

    def block(self, statements: list[ast.stmt], depth: int) -> list[str]:
        """Lines of a block."""
        return [line for statement in statements for line in self.statement(statement, depth)]

    def statement(self, node: ast.stmt, depth: int) -> list[str]:
        """Lines of a statement."""
        pad = "    " * depth
        match node:
            case ast.Expr(value=ast.Constant()) | ast.Pass():
                return []
            case ast.Expr(value=ast.Call() as call):
                return [f"{pad}{self.value(call)[0]};"]
            case ast.Assign(targets=targets, value=value):
                return self.assigned(targets, value, pad)
            case ast.AnnAssign(target=target, value=ast.expr() as value):
                return self.assigned([target], value, pad)
            case ast.AugAssign(target=target, op=operator, value=value):
                together = ast.copy_location(ast.BinOp(_loaded(target), operator, value), node)
                return self.assigned([target], together, pad)
            case ast.If(test=test, body=body, orelse=other):
                lines = [f"{pad}if ({self.truth(test)}) {{", *self.block(body, depth + 1)]
                if other:
                    lines += [f"{pad}}} else {{", *self.block(other, depth + 1)]
                return [*lines, f"{pad}}}"]
            case ast.While(test=test, body=body, orelse=[]):
                return [f"{pad}while ({self.truth(test)}) {{", *self.block(body, depth + 1), f"{pad}}}"]
            case ast.For(target=ast.Name(id=name), iter=ast.Call(func=ast.Name(id="range"), args=limits), orelse=[]):
                return [f"{pad}{self.loop(name, limits)} {{", *self.block(node.body, depth + 1), f"{pad}}}"]
            case ast.Break():
                return [f"{pad}break;"]
            case ast.Continue():
                return [f"{pad}continue;"]
            case ast.Return(value=None):
                return [f"{pad}return;"]
            case ast.Return(value=ast.expr() as value) if self.returns:
                return [f"{pad}return {self.value(value)[0]};"]
            case _:
                raise self.cannot(node)

    def loop(self, name: str, limits: list[ast.expr]) -> str:
        """Head of a loop over a range."""
        step = 1
        match limits:
            case [end]:
                first, last = "0", self.whole(end)
            case [begin, end]:
                first, last = self.whole(begin), self.whole(end)
            case [begin, end, ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=1))]:
                first, last, step = self.whole(begin), self.whole(end), -1
            case _:
                raise self.cannot(limits[-1])
        if name not in self.arguments:
            self.local(name, INT, limits[0])
        return f"for ({name} = {first}; {name} {'<' if step == 1 else '>'} {last}; {name} += {step})"

    def assigned(self, targets: list[ast.expr], node: ast.expr, pad: str) -> list[str]:
        """An assignment, to one target or to several."""
        match targets, node:
            case [ast.Name(id=name)], ast.Call(
                func=ast.Attribute(value=ast.Name(id="np"), attr="empty" | "zeros" as how)
            ):
                return self.new_array(name, how, node, pad)
            case _:
                pass
        text, kind = self.value(node)
        lines: list[str] = []
        for target in targets:
            match target:
                case ast.Name(id=name):
                    if name not in self.arguments:
                        self.local(name, kind, node)
                    elif self.arguments[name].shape:
                        raise self.cannot(target)
                    if kind == INT and text.isidentifier() and text.isupper():
                        self.sizes[name] = text
                    place = name
                case ast.Subscript():
                    place, _ = self.element(target)
                case _:
                    raise self.cannot(target)
            lines.append(f"{pad}{place} = {text};")
        return lines

    def new_array(self, name: str, how: str, call: ast.Call, pad: str) -> list[str]:
        """A local array."""
        match call.args:
            case [ast.Tuple(elts=sizes)]:
                shape = tuple(self.size(size) for size in sizes)
            case [size]:
                shape = (self.size(size),)
            case _:
                raise self.cannot(call)
        self.local(name, array(*shape), call)
        self.arrays.add(name)
        return [f"{pad}memset({name}, 0, sizeof {name});"] if how == "zeros" else []

    def local(self, name: str, kind: CType, node: ast.AST) -> None:
        """Note the type of a local; a number that was whole may become a float."""
        before = self.locals.get(name)
        if before is None or (before == INT and kind == DOUBLE):
            self.locals[name] = kind
        elif before != kind and not (before == DOUBLE and kind == INT):
            raise self.cannot(node)

    # expressions

    def value(self, node: ast.expr) -> tuple[str, CType]:
        """Text and type of an expression."""
        match node:
            case ast.Constant(value=bool() as value):
                return str(int(value)), INT
            case ast.Constant(value=int() as value):
                return str(value), INT
            case ast.Constant(value=float() as value):
                return number(value), DOUBLE
            case ast.Name(id=name):
                return self.name(name, node)
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in _CONSTANTS:
                return number(_CONSTANTS[name]), DOUBLE
            case ast.Attribute(value=ast.Name(id="math"), attr="inf"):
                return "HUGE_VAL", DOUBLE
            case ast.Attribute(value=ast.Name(id=name), attr=part) if name in self.arguments:
                fields = self.structs.get(self.arguments[name].base, {})
                if part in fields:
                    return f"{name}->{part}", fields[part]
                raise self.cannot(node)
            case ast.Subscript(value=ast.Attribute(value=owner, attr="shape"), slice=ast.Constant(value=int() as axis)):
                _, kind = self.value(owner)
                return kind.shape[axis], INT
            case ast.Subscript():
                return self.element(node)
            case ast.UnaryOp(op=ast.USub(), operand=operand):
                text, kind = self.single(operand)
                return f"(-{text})", kind
            case ast.UnaryOp(op=ast.UAdd(), operand=operand):
                return self.single(operand)
            case ast.UnaryOp(op=ast.Not()) | ast.Compare() | ast.BoolOp():
                return self.truth(node), INT
            case ast.BinOp(left=left, op=operator, right=right):
                return self.operation(left, operator, right, node)
            case ast.IfExp(test=test, body=body, orelse=other):
                (first, kind), (second, second_kind) = self.single(body), self.single(other)
                return f"({self.truth(test)} ? {first} : {second})", _wider(kind, second_kind)
            case ast.Call():
                return self.call(node)
            case _:
                raise self.cannot(node)

    def name(self, name: str, node: ast.expr) -> tuple[str, CType]:
        """A variable, or a constant of the function's module."""
        if name in self.locals:
            return name, self.locals[name]
        if name in self.arguments:
            return name, self.arguments[name]
        match self.scope.get(name):
            case bool() | int() as value:
                return f"({int(value)})" if value < 0 else str(int(value)), INT
            case float() as value if math.isfinite(value):
                return f"({number(value)})" if value < 0.0 else number(value), DOUBLE
            case _:
                raise self.cannot(node)

    def element(self, node: ast.Subscript) -> tuple[str, CType]:
        """An element or a row of an array."""
        text, kind = self.value(node.value)
        indices = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        from_behind = any(isinstance(index, ast.UnaryOp) for index in indices)
        if len(indices) > len(kind.shape) or from_behind:
            raise self.cannot(node)
        places = "".join(f"[{self.whole(index)}]" for index in indices)
        return text + places, CType(kind.base, kind.shape[len(indices) :])

    def single(self, node: ast.expr) -> tuple[str, CType]:
        """An expression that is one number."""
        text, kind = self.value(node)
        if kind not in (INT, DOUBLE):
            raise self.cannot(node)
        return text, kind

    def whole(self, node: ast.expr) -> str:
        """An expression that is a whole number."""
        text, kind = self.value(node)
        if kind != INT:
            raise self.cannot(node)
        return text

    def size(self, node: ast.expr) -> str:
        """Size of an array: known when C is compiled."""
        if isinstance(node, ast.Name) and node.id in self.sizes:
            return self.sizes[node.id]
        text = self.whole(node)
        if not (text.isdigit() or text.isupper()):
            raise self.cannot(node)
        return text

    def truth(self, node: ast.expr) -> str:
        """An expression that is true or false."""
        match node:
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                return f"(!{self.truth(operand)})"
            case ast.BoolOp(op=operator, values=values):
                return "(" + (" && " if isinstance(operator, ast.And) else " || ").join(map(self.truth, values)) + ")"
            case ast.Compare(left=left, ops=[ast.In()], comparators=[ast.Tuple(elts=members)]):
                text = self.single(left)[0]
                return "(" + " || ".join(f"{text} == {self.single(member)[0]}" for member in members) + ")"
            case ast.Compare(left=left, ops=operators, comparators=others):
                texts = [self.single(part)[0] for part in (left, *others)]
                parts: list[str] = []
                for operator, first, second in zip(operators, texts[:-1], texts[1:], strict=True):
                    if type(operator) not in _COMPARISONS:
                        raise self.cannot(node)
                    parts.append(f"{first} {_COMPARISONS[type(operator)]} {second}")
                return "(" + " && ".join(parts) + ")"
            case _:
                return self.single(node)[0]

    def operation(self, left: ast.expr, operator: ast.operator, right: ast.expr, node: ast.AST) -> tuple[str, CType]:
        """Arithmetic as Python means it."""
        (first, kind), (second, second_kind) = self.single(left), self.single(right)
        both = _wider(kind, second_kind)
        if type(operator) in _OPERATORS:
            return f"({first} {_OPERATORS[type(operator)]} {second})", both
        match operator:
            case ast.Div():
                return f"((double)({first}) / {second})" if both == INT else f"({first} / {second})", DOUBLE
            case ast.Pow():
                return f"pow({first}, {second})", DOUBLE
            case ast.FloorDiv() if both == DOUBLE:
                return f"floor({first} / {second})", DOUBLE
            case ast.FloorDiv():
                return f"(int)floor((double)({first}) / {second})", INT
            case ast.Mod() if both == DOUBLE:
                return f"modulo({first}, {second})", DOUBLE
            case _:
                raise self.cannot(node)

    def call(self, node: ast.Call) -> tuple[str, CType]:
        """A call of a function that C has, or that is written beside this one."""
        if node.keywords:
            raise self.cannot(node)
        match node.func:
            case ast.Attribute(value=ast.Name(id="math"), attr=name) if name in _FUNCTIONS:
                text = f"{_FUNCTIONS[name]}({', '.join(self.single(argument)[0] for argument in node.args)})"
                if name in _WHOLE:
                    return f"(int){text}", INT
                return (text, INT) if name in _TRUTHS else (text, DOUBLE)
            case ast.Name(id="len"):
                return self.value(node.args[0])[1].shape[0], INT
            case ast.Name(id="abs"):
                text, kind = self.single(node.args[0])
                return (f"fabs({text})", DOUBLE) if kind == DOUBLE else (f"abs({text})", INT)
            case ast.Name(id="float"):
                return f"(double)({self.single(node.args[0])[0]})", DOUBLE
            case ast.Name(id="int"):
                return f"(int)({self.single(node.args[0])[0]})", INT
            case ast.Name(id="min" | "max" as name) if len(node.args) > 1:
                parts = [self.single(argument)[0] for argument in node.args]
                text = parts[0]
                for part in parts[1:]:
                    text = f"{'smaller' if name == 'min' else 'larger'}({text}, {part})"
                return text, DOUBLE
            case ast.Name(id=name) if name in self.known:
                known = self.known[name]
                parts = [self.value(argument)[0] for argument in node.args]
                return f"{known.name}({', '.join(parts)})", known.returns or CType("void")
            case ast.Name(id=name) if name in self.arguments and not self.arguments[name].shape:
                # a function that was handed over
                return f"{name}({', '.join(self.value(argument)[0] for argument in node.args)})", DOUBLE
            case _:
                raise self.cannot(node)

    @staticmethod
    def cannot(node: ast.AST) -> UntranslatableError:
        """The error of a part that has no form in C."""
        return UntranslatableError(f"line {getattr(node, 'lineno', 1)} of its text, {ast.unparse(node)!r}")


def _wider(first: CType, second: CType) -> CType:
    return INT if first == second == INT else DOUBLE


def _loaded(target: ast.expr) -> ast.expr:
    """The target of an assignment as a value."""
    return ast.parse(ast.unparse(target), mode="eval").body
