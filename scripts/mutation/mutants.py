"""Mutants of a file: its text with one small change each.

A mutant changes a comparison, an operator, a number or a condition, or leaves a call, an assignment or an error out.
"""

from __future__ import annotations

import ast
import copy
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

OPPOSITES: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.BitOr: ast.BitAnd,
    ast.BitAnd: ast.BitOr,
    ast.Pow: ast.Mult,
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "popleft": "pop", "appendleft": "append"}


@dataclass(frozen=True)
class Mutant:
    """One change of one file.

    Attributes:
        index: of the changed node, in the order of `_nodes`.
        variant: number of the change of that node.
        line: line of the node.
        change: old and new text.
    """

    index: int
    variant: int
    line: int
    change: str


@cache
def mutants_of(source: str) -> list[Mutant]:
    """Return all mutants of a file.

    Args:
        source: the file's text.

    Returns:
        The mutants, in the file's order.
    """
    found = []
    for index, node in enumerate(_nodes(ast.parse(source))):
        for variant, (old, new) in enumerate(_variants(node)):
            change = f"{_text(old)}  ->  {_text(new)}"
            found.append(Mutant(index, variant, getattr(node, "lineno", 0), change))
    return found


def has_mutants(source: str) -> bool:
    """Whether a file has any mutant, in a fraction of the time that all of them take."""
    return any(True for node in _nodes(ast.parse(source)) for _ in _variants(node))


def mutate(source: str, mutant: Mutant) -> ast.Module:
    """Return the tree of a file with one change.

    Args:
        source: the file's text.
        mutant: the change.

    Returns:
        The tree, ready to compile.
    """
    tree = ast.parse(source)
    node = list(_nodes(tree))[mutant.index]
    old, new = list(_variants(node))[mutant.variant]
    _Exchange(old, new).visit(tree)
    return ast.fix_missing_locations(tree)


class _Exchange(ast.NodeTransformer):
    """Transformer that replaces one node by another."""

    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old, self._new = old, ast.copy_location(new, old)

    def visit(self, node: ast.AST) -> ast.AST:
        """Visit a node; see the base class."""
        return self._new if node is self._old else self.generic_visit(node)


def _nodes(tree: ast.Module) -> Iterator[ast.AST]:
    """Yield the nodes of all function bodies and of the constant numbers of a module.

    Annotations, defaults, decorators, assertions and error texts are left out.
    """
    waiting: list[tuple[ast.AST, bool]] = [(tree, False)]
    while waiting:
        node, is_inside = waiting.pop()
        if isinstance(node, ast.Assert):
            continue
        if is_inside:
            yield node
        if isinstance(node, ast.Raise):
            continue
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            waiting += [(child, True) for child in reversed(node.body)]
        elif isinstance(node, ast.Module):
            waiting += [_constant_of(child) or (child, False) for child in reversed(node.body)]
        elif isinstance(node, ast.AnnAssign):
            waiting += [(child, is_inside) for child in (node.value,) if child is not None]
        else:
            waiting += [(child, is_inside) for child in reversed(list(ast.iter_child_nodes(node)))]


def _constant_of(statement: ast.stmt) -> tuple[ast.AST, bool] | None:
    """Return the value of a module's constant that is made of numbers, as a node to look into; None for the rest."""
    value = statement.value if isinstance(statement, (ast.Assign, ast.AnnAssign)) else None
    if value is None:
        return None
    parts = [part for part in ast.walk(value) if isinstance(part, ast.expr)]
    is_tuned = all(isinstance(part, (ast.Constant, ast.UnaryOp, ast.BinOp, ast.Tuple)) for part in parts)
    return (value, True) if is_tuned else None


def _variants(node: ast.AST) -> Iterator[tuple[ast.AST, ast.AST]]:  # noqa: C901, PLR0912 - one case for each sort of node
    """Yield each part of a node that may change, with its replacement."""

    def changed(**fields: object) -> tuple[ast.AST, ast.AST]:
        new = copy.copy(node)
        for name, value in fields.items():
            setattr(new, name, value)
        return node, new

    match node:
        case ast.Compare(ops=ops):
            for i, op in enumerate(ops):
                yield changed(ops=[*ops[:i], OPPOSITES[type(op)](), *ops[i + 1 :]])
        case ast.BoolOp(op=op, values=values):
            yield changed(op=OPPOSITES[type(op)]())
            for i in range(len(values)):
                left = [*values[:i], *values[i + 1 :]]
                yield node, left[0] if len(left) == 1 else ast.BoolOp(op, left)
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in OPPOSITES:
            yield changed(op=OPPOSITES[type(op)]())
        case ast.UnaryOp(op=ast.Not() | ast.USub(), operand=operand):
            yield node, operand
        case ast.Constant(value=bool(value)):
            yield changed(value=not value)
        case ast.Constant(value=int(value) | float(value)) if abs(value) <= 2:
            yield changed(value=value + 1)
        case ast.Constant(value=int(value) | float(value)):
            yield changed(value=value * 2)
        case ast.Name(id=name) if name in NAMES:
            yield changed(id=NAMES[name])
        case ast.Attribute(attr=name) if name in NAMES:
            yield changed(attr=NAMES[name])
        case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
            yield test, ast.UnaryOp(ast.Not(), test)
            yield test, ast.Constant(value=False)
        case ast.Break():
            yield node, ast.Continue()
        case ast.Continue():
            yield node, ast.Break()
        case ast.Return(value=ast.expr() as value) if not isinstance(value, ast.Constant):
            yield changed(value=ast.Constant(value=None))
    if isinstance(node, (ast.Assign, ast.AugAssign, ast.Delete, ast.Raise)) or (
        isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
    ):
        yield node, ast.Pass()


def _text(node: ast.AST) -> str:
    return " ".join(ast.unparse(node).split())[:100]
