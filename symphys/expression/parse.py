"""Parse a formula: a Python syntax tree of bounded size, of which a fixed list of nodes is allowed.

Every failure is a FormulaError.
"""

from __future__ import annotations

import ast
import copyreg
import warnings
from collections.abc import Callable
from functools import lru_cache, partial
from math import isfinite
from operator import neg, pos

import casadi as ca

from symphys.expression import columns
from symphys.expression.columns import FormulaError
from symphys.expression.formula import Constant, Formula, MotionPart, Node, Reference, apply
from symphys.expression.functions import CONSTANTS, FUNCTIONS, INSTANTS, OF_INSTANTS, OVER_TIME, elementwise
from symphys.suggest import hint, quote
from symphys.types import Expr

MAX_LENGTH = 10_000
MAX_NODES = 2_000
MAX_DEPTH = 100

REPLACEMENTS = {
    "\u00d7": "*",
    "\u00b7": "*",
    "\u00f7": "/",
    "\u2212": "-",
    "\u2013": "-",
    "\u00b2": "**2",
    "\u00b3": "**3",
    "\u03c0": "pi",
    "\u221a": "sqrt()",
}
"""Typographic characters that people paste, and what to write instead."""
FORBIDDEN = "#\\\x00"
OPERATORS: dict[type[ast.operator], Callable[..., Expr]] = {
    ast.Add: elementwise(ca.plus),
    ast.Sub: elementwise(ca.minus),
    ast.Mult: elementwise(ca.times),
    ast.Div: elementwise(ca.rdivide),
    ast.Pow: elementwise(ca.power),
}
SIGNS: dict[type[ast.unaryop], Callable[..., Expr]] = {ast.UAdd: pos, ast.USub: neg}
ALLOWED = (
    "a formula has numbers, names, + - * / **, components [i], ranges [i:j], vectors [a, b] and calls of functions"
)
ONE_INSTANT = "costs, targets, constraints and outputs are of whole motions; this formula is of one instant"


def flatten(text: str) -> str:
    """Return the text on one line, stripped; FormulaError for a character that no formula has."""
    if len(text) > MAX_LENGTH:
        raise FormulaError(f"the formula has {len(text)} characters; {MAX_LENGTH} are allowed")
    line = "".join(" " if c in "\t\r\n" else c for c in text).strip(" ")
    if not line:
        raise FormulaError("the formula is empty")
    for c in line:
        if not " " <= c <= "~" or c in FORBIDDEN:
            instead = f"; write {REPLACEMENTS[c]}" if c in REPLACEMENTS else ""
            raise FormulaError(f"the character {c!r} is not allowed in the formula {quote(line)}{instead}")
    return line


def read(line: str) -> ast.expr:
    """Return the syntax tree of one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # the tokeniser warns of such things as 1if
            root = ast.parse(line, mode="eval").body
    except SyntaxError as error:
        raise FormulaError(f"cannot read the formula {quote(line)}: {syntax_fault(error)}") from None
    except (RecursionError, MemoryError):
        raise FormulaError(f"the formula {quote(line)} is nested too deep; {MAX_DEPTH} levels are allowed") from None
    except (ValueError, OverflowError, Warning) as error:
        raise FormulaError(f"cannot read the formula {quote(line)}: {error}") from None
    require_size(root, line)
    return root


def syntax_fault(error: SyntaxError) -> str:
    """Return the parser's message with the column, without Python's advice to programmers."""
    reason = (error.msg or "invalid syntax").split(". Perhaps")[0].split(";")[0]
    return f"{reason} at column {error.offset}" if error.offset else reason


def require_size(root: ast.expr, line: str) -> None:
    """Raise FormulaError for a tree with too many nodes or levels, without recursion."""
    level: list[ast.AST] = [root]
    nodes = depth = 0
    while level:
        nodes, depth = nodes + len(level), depth + 1
        if nodes > MAX_NODES:
            raise FormulaError(f"the formula {quote(line)} is too long; {MAX_NODES} pieces are allowed")
        if depth > MAX_DEPTH:
            raise FormulaError(
                f"the formula {quote(line)} is nested too deep; {MAX_DEPTH} levels are allowed "
                "(write a long sum as sum([a, b, c]))"
            )
        level = [child for node in level for child in ast.iter_child_nodes(node) if isinstance(child, ast.expr)]


@lru_cache(maxsize=1024)
def parse(text: str, whole: bool = False) -> Formula:
    """Read a formula; FormulaError names the piece at fault, what is allowed and the nearest valid names.

    ``whole``: whether parts of a whole motion are allowed: ``start.NAME``, ``end.NAME``, ``integral(...)``.
    """
    builder = Builder(flatten(text), whole)
    return builder.formula(text, read(builder.line))


# a formula travels to other processes as its text
copyreg.pickle(Formula, lambda formula: (parse, (formula.text, bool(formula.parts))))


class Builder:
    """The conversion of syntax into nodes, which collects the names on the way."""

    def __init__(self, line: str, whole: bool = False) -> None:
        """Keep the line, from which errors quote, and whether parts of a whole motion are allowed."""
        self.line, self.whole, self.instant = line, whole, ONE_INSTANT
        self.names: set[str] = set()
        self.parts: dict[str, MotionPart] = {}
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

    def formula(self, text: str, syntax: ast.expr) -> Formula:
        """Return the formula of a piece of syntax."""
        root = self.build(syntax)
        return Formula(text, frozenset(self.names), root, tuple(self.parts.values()))

    def build(self, syntax: ast.expr) -> Node:
        """Return the node of a piece of syntax."""
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
        if syntax.id in OVER_TIME:
            raise FormulaError(f"{quote(syntax.id)} is of a whole motion; write {OVER_TIME[syntax.id]}")
        return self._reference(syntax.id)

    def _dotted(self, syntax: ast.Attribute) -> Node:
        words = self._piece(syntax).replace(" ", "").split(".")
        plain = isinstance(syntax.value, ast.Name) or (
            isinstance(syntax.value, ast.Attribute) and isinstance(syntax.value.value, ast.Name)
        )
        if plain and words[0] in INSTANTS and (len(words) == 3 or words[1] in OF_INSTANTS):
            name = ".".join(words[1:])
            return self._part(syntax, words[0], ".".join(words), Formula(name, frozenset({name}), Reference(name)))
        if not isinstance(syntax.value, ast.Name):
            advice = "a name has at most one dot; components are [0], [1], ...; only start. and end. add one"
            raise FormulaError(f"{quote(self._piece(syntax))} is not allowed; {advice}")
        return self._reference(f"{syntax.value.id}.{syntax.attr}")

    def _part(self, syntax: ast.expr, kind: str, name: str, formula: Formula) -> Node:
        """Return a reference to a part of the whole motion, under a name of its own."""
        if not self.whole:
            raise FormulaError(f"{quote(self._piece(syntax))} is of a whole motion; {self.instant}")
        self.parts[name] = MotionPart(name, kind, formula)  # type: ignore[arg-type]
        return self._reference(name)

    def _over_time(self, syntax: ast.Call, kind: str) -> Node:
        """Return the integral or average of a formula of one instant."""
        if len(syntax.args) != 1 or syntax.keywords:
            raise FormulaError(f"{quote(self._piece(syntax))}: one formula is wanted; {OVER_TIME[kind]}")
        inner = Builder(self.line)
        inner.instant = f"what has an {kind} is of one instant"
        formula = inner.formula(self._piece(syntax.args[0]), syntax.args[0])
        return self._part(syntax, kind, self._piece(syntax), formula)

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
        if syntax.func.id in OVER_TIME:
            return self._over_time(syntax, syntax.func.id)
        function = FUNCTIONS.get(syntax.func.id)
        if function is None:
            known = hint(syntax.func.id, [*FUNCTIONS, *OVER_TIME])
            raise FormulaError(f"unknown function {quote(syntax.func.id)} in {quote(piece)}; {known}")
        if syntax.keywords or any(isinstance(argument, ast.Starred) for argument in syntax.args):
            raise FormulaError(f"{quote(piece)}: arguments are plain values; write {function.signature}")
        count = len(syntax.args)
        if count < function.least or (function.most is not None and count > function.most):
            raise FormulaError(f"{quote(piece)} has {count} arguments; write {function.signature}")
        return apply(function.apply, tuple(self.build(argument) for argument in syntax.args), piece)
