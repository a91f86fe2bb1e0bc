"""Mutants of a module: its text with one thing changed, as a slip of the hand might change it.

Texts (messages, docstrings), annotations and decorators are left alone: they say, and do not compute.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass
from typing import Any, cast

_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
"""Each comparison with its neighbour at the boundary and with its opposite."""

_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.Pow: ast.Mult,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.BitXor: ast.BitAnd,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
}

_PAIRS = (("min", "max"), ("minimum", "maximum"), ("floor", "ceil"), ("sin", "cos"), ("any", "all"))
_NAMES = dict(_PAIRS) | {right: left for left, right in _PAIRS}
_COMMUTE = {"max", "maximum", "min", "minimum", "hypot", "isclose", "range", "isinstance"}
"""Functions whose arguments mean the same in any order, or nothing at all in another."""


@dataclass(frozen=True, slots=True)
class Mutant:
    """The whole text of a changed module, the line that changed, and what kind of change it was."""

    kind: str
    line: int
    text: str
    diff: tuple[str, ...]


def mutants(text: str) -> list[Mutant]:
    """All mutants of a module's text that are programs, in the order of lines."""
    raw = text.encode()
    starts = [0]
    for line in raw.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    found: dict[str, Mutant] = {}
    for kind, node, new in _changes(ast.parse(text)):
        where = node.__dict__
        row, last_row = where["lineno"], where["end_lineno"]
        begin, end = starts[row - 1] + where["col_offset"], starts[last_row - 1] + where["end_col_offset"]
        changed = (raw[:begin] + new.encode() + raw[end:]).decode()
        if changed not in found and _is_program(changed):
            found[changed] = Mutant(kind, row, changed, _diff(text, changed, row, last_row))
    return sorted(found.values(), key=lambda mutant: mutant.line)


def _changes(tree: ast.AST) -> Iterator[tuple[str, ast.AST, str]]:
    """Kind of a change, the node that it takes the place of, and the new source."""
    for node in _computed(tree):
        if isinstance(node, ast.expr):
            for kind, new in _of_expression(node):
                source = ast.unparse(new)
                plain = isinstance(new, ast.Constant | ast.Call | ast.Name)
                yield kind, node, source if plain else f"({source})"
        elif isinstance(node, ast.If | ast.While) and isinstance(
            node.test, ast.Name | ast.Attribute | ast.Call
        ):
            yield "condition", node.test, f"(not ({ast.unparse(node.test)}))"
        elif isinstance(node, ast.AugAssign) and type(node.op) in _OPERATORS:
            changed = deepcopy(node)
            changed.op = _OPERATORS[type(node.op)]()
            yield "operator", node, ast.unparse(changed)
        elif isinstance(node, ast.Return) and not _is_none(node.value):
            yield "result", node, "return None"
        elif isinstance(node, ast.Raise) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)):
            yield "deletion", node, "pass"
        elif isinstance(node, ast.Break | ast.Continue):
            yield "jump", node, "continue" if isinstance(node, ast.Break) else "break"


def _of_expression(node: ast.expr) -> Iterator[tuple[str, ast.expr]]:
    if isinstance(node, ast.Compare):
        for place, op in enumerate(node.ops):
            for other in _COMPARISONS[type(op)]:
                compared = deepcopy(node)
                compared.ops[place] = other()
                yield "comparison", compared
    elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        yield "operator", ast.BinOp(node.left, _OPERATORS[type(node.op)](), node.right)
    elif isinstance(node, ast.BoolOp):
        yield "and/or", ast.BoolOp(ast.Or() if isinstance(node.op, ast.And) else ast.And(), node.values)
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
        yield "sign" if isinstance(node.op, ast.USub) else "not", node.operand
    elif isinstance(node, ast.IfExp):
        yield "branches", ast.IfExp(node.test, node.orelse, node.body)
    elif isinstance(node, ast.Constant):
        yield from (("constant", ast.Constant(cast("Any", value))) for value in _other_values(node.value))
    elif isinstance(node, ast.Call):
        yield from _of_call(node)


def _of_call(node: ast.Call) -> Iterator[tuple[str, ast.expr]]:
    name = node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
    if name in _NAMES:
        renamed = deepcopy(node)
        if isinstance(renamed.func, ast.Attribute):
            renamed.func.attr = _NAMES[name]
        else:
            renamed.func = ast.Name(_NAMES[name])
        yield "function", renamed
    if len(node.args) > 1 and name not in _COMMUTE:
        first, second, *rest = node.args
        if ast.dump(first) != ast.dump(second):
            yield "arguments", ast.Call(node.func, [second, first, *rest], node.keywords)


def _other_values(value: object) -> tuple[object, ...]:
    if isinstance(value, bool):
        return (not value,)
    if isinstance(value, int):
        return (value + 1,)
    if isinstance(value, float):
        return (2.0 * value if value else 1.0,)
    return ()


def _computed(node: ast.AST) -> Iterator[ast.AST]:
    """A node and all below it, without texts, annotations and decorators."""
    if isinstance(node, ast.JoinedStr):
        return
    yield node
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "bases"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST):
                yield from _computed(child)


def _is_none(node: ast.expr | None) -> bool:
    return node is None or (isinstance(node, ast.Constant) and node.value is None)


def _is_program(text: str) -> bool:
    try:
        ast.parse(text)
    except SyntaxError:
        return False
    return True


def _diff(text: str, changed: str, row: int, last_row: int) -> tuple[str, ...]:
    """The lines from one row to another, and what has taken their place."""
    old, new = text.splitlines(), changed.splitlines()
    gone, come = old[row - 1 : last_row], new[row - 1 : last_row + len(new) - len(old)]
    return (*(f"- {line.strip()}" for line in gone), *(f"+ {line.strip()}" for line in come))
