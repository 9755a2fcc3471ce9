"""From a syntax tree to a formula: a fixed list of nodes is let through, everything else is an error."""

from __future__ import annotations

import ast
import copyreg
from collections.abc import Callable
from functools import lru_cache, partial
from math import isfinite
from operator import neg, pos

import casadi as ca

from symphys.expression import columns
from symphys.expression.errors import FormulaError
from symphys.expression.formula import Formula
from symphys.expression.functions import FUNCTIONS, elementwise
from symphys.expression.names import CONSTANTS
from symphys.expression.source import flatten, read
from symphys.expression.tree import Constant, Node, Reference, apply
from symphys.suggest import hint, quote

OPERATORS: dict[type[ast.operator], Callable[..., columns.Expr]] = {
    ast.Add: elementwise(ca.plus),
    ast.Sub: elementwise(ca.minus),
    ast.Mult: elementwise(ca.times),
    ast.Div: elementwise(ca.rdivide),
    ast.Pow: elementwise(ca.power),
}
SIGNS: dict[type[ast.unaryop], Callable[..., columns.Expr]] = {ast.UAdd: pos, ast.USub: neg}
ALLOWED = (
    "a formula has numbers, names, + - * / **, components [i], ranges [i:j], vectors [a, b] and calls of functions"
)


@lru_cache(maxsize=1024)
def parse(text: str) -> Formula:
    """Read a formula; FormulaError names the piece at fault, what is allowed and the nearest valid names."""
    builder = Builder(flatten(text))
    root = builder.build(read(builder.line))
    return Formula(text, frozenset(builder.names), root)


copyreg.pickle(Formula, lambda formula: (parse, (formula.text,)))  # a formula travels to other processes as its text


class Builder:
    """Turns syntax into nodes and collects the names on the way."""

    def __init__(self, line: str) -> None:
        """Keep the line, from which errors quote."""
        self.line = line
        self.names: set[str] = set()
        self._rules: dict[type[ast.expr], Callable[..., Node]] = {
            ast.Constant: self._number,
            ast.Name: self._name,
            ast.Attribute: self._dotted,
            ast.UnaryOp: self._sign,
            ast.BinOp: self._operation,
            ast.Subscript: self._index,
            ast.List: self._list,
            ast.Call: self._call,
        }

    def build(self, syntax: ast.expr) -> Node:
        """The node of a piece of syntax."""
        rule = self._rules.get(type(syntax))
        if rule is None:
            raise self._refused(syntax)
        return rule(syntax)

    def _piece(self, syntax: ast.expr) -> str:
        return self.line[syntax.col_offset : syntax.end_col_offset]

    def _refused(self, syntax: ast.expr) -> FormulaError:
        advice = {
            ast.Tuple: "write a vector with square brackets",
            ast.Compare: "there are no comparisons; use min, max, clip or sign",
            ast.IfExp: "there are no conditions; use min, max, clip or sign",
        }.get(type(syntax), ALLOWED)
        return FormulaError(f"{quote(self._piece(syntax))} is not allowed; {advice}")

    def _number(self, syntax: ast.Constant) -> Node:
        if type(syntax.value) not in (int, float):
            raise self._refused(syntax)
        try:
            value = float(syntax.value)  # type: ignore[arg-type]  # an int or a float by the line above
        except OverflowError:
            value = float("inf")
        if not isfinite(value):
            raise FormulaError(f"the number {quote(self._piece(syntax))} is too large")
        return Constant(ca.DM(value))

    def _name(self, syntax: ast.Name) -> Node:
        if syntax.id in CONSTANTS:
            return Constant(ca.DM(CONSTANTS[syntax.id]))
        if syntax.id in FUNCTIONS:
            raise FormulaError(f"{quote(syntax.id)} is a function; write {FUNCTIONS[syntax.id].signature}")
        return self._reference(syntax.id)

    def _dotted(self, syntax: ast.Attribute) -> Node:
        if not isinstance(syntax.value, ast.Name):
            advice = "a name has at most one dot; components are [0], [1], ..."
            raise FormulaError(f"{quote(self._piece(syntax))} is not allowed; {advice}")
        return self._reference(f"{syntax.value.id}.{syntax.attr}")

    def _reference(self, name: str) -> Node:
        self.names.add(name)
        return Reference(name)

    def _sign(self, syntax: ast.UnaryOp) -> Node:
        if type(syntax.op) not in SIGNS:
            raise self._refused(syntax)
        return apply(SIGNS[type(syntax.op)], (self.build(syntax.operand),), self._piece(syntax))

    def _operation(self, syntax: ast.BinOp) -> Node:
        operation = OPERATORS.get(type(syntax.op))
        if operation is None:
            advice = "powers are written **" if isinstance(syntax.op, ast.BitXor) else "the operators are + - * / **"
            raise FormulaError(f"the operator in {quote(self._piece(syntax))} is not allowed; {advice}")
        sides = (self.build(syntax.left), self.build(syntax.right))
        return apply(operation, sides, self._piece(syntax))

    def _list(self, syntax: ast.List) -> Node:
        if not syntax.elts:
            raise FormulaError("a vector needs at least one component, [] has none")
        return apply(columns.join, tuple(self.build(item) for item in syntax.elts), self._piece(syntax))

    def _index(self, syntax: ast.Subscript) -> Node:
        value = self.build(syntax.value)
        key = syntax.slice
        if isinstance(key, ast.Slice):
            bounds = (self._integer(end, syntax) if end else None for end in (key.lower, key.upper, key.step))
            select = partial(columns.part, key=slice(*bounds))
        else:
            select = partial(columns.component, index=self._integer(key, syntax))
        return apply(select, (value,), self._piece(syntax))

    def _integer(self, syntax: ast.expr, whole: ast.Subscript) -> int:
        sign = 1
        if isinstance(syntax, ast.UnaryOp) and isinstance(syntax.op, ast.USub):
            sign, syntax = -1, syntax.operand
        if not (isinstance(syntax, ast.Constant) and type(syntax.value) is int):
            raise FormulaError(
                f"{quote(self._piece(whole))}: an index is one integer, as in [2], or a range, as in [0:2]"
            )
        return sign * syntax.value

    def _call(self, syntax: ast.Call) -> Node:
        piece = self._piece(syntax)
        if not isinstance(syntax.func, ast.Name):
            raise FormulaError(f"{quote(piece)} is not allowed; only functions by plain name are called")
        function = FUNCTIONS.get(syntax.func.id)
        if function is None:
            raise FormulaError(
                f"unknown function {quote(syntax.func.id)} in {quote(piece)}; {hint(syntax.func.id, FUNCTIONS)}"
            )
        if syntax.keywords or any(isinstance(argument, ast.Starred) for argument in syntax.args):
            raise FormulaError(f"{quote(piece)}: arguments are plain values; write {function.signature}")
        count = len(syntax.args)
        if count < function.least or (function.most is not None and count > function.most):
            raise FormulaError(f"{quote(piece)} has {count} arguments; write {function.signature}")
        return apply(function.apply, tuple(self.build(argument) for argument in syntax.args), piece)
