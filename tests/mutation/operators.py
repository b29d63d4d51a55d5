"""Mutants of source code: one comparison, condition, sign, number or name turned into another one.

Ours and not mutmut's or cosmic-ray's: they run a whole test session for each mutant of each line of a file.
Here a mutant may be of some functions alone, is tried by one check in this process (`tests/unit/gateway`) or
in a child that is forked from a warm one (`mutants.py`), and Hypothesis searches in it anew.
"""

import ast
import copy
from collections.abc import Callable, Container, Iterator
from enum import Flag, auto

Change = Callable[[ast.AST], None]

NEIGHBOURS: dict[type[ast.cmpop], type[ast.cmpop]] = {  # where there is a boundary: the hardest to notice
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
}
OPPOSITES: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.Gt,
    ast.LtE: ast.GtE,
    ast.Gt: ast.Lt,
    ast.GtE: ast.LtE,
}
CONDITIONS: dict[type[ast.boolop], type[ast.boolop]] = {ast.And: ast.Or, ast.Or: ast.And}
SIGNS: dict[type[ast.operator], type[ast.operator]] = {ast.Add: ast.Sub, ast.Sub: ast.Add}
FACTORS: dict[type[ast.operator], type[ast.operator]] = {ast.Mult: ast.Div, ast.Div: ast.Mult}
NAMES = {"lt": ("le", "gt"), "gt": ("ge", "lt"), "min": ("max",), "max": ("min",)}


class Kind(Flag):
    """What is changed."""

    DECISIONS = auto()  # comparisons to their neighbours, conditions, signs
    NUMBERS = auto()  # numbers, factors, comparisons to their opposites, `min` and `max`
    ALL = DECISIONS | NUMBERS


def mutants(
    tree: ast.Module, kind: Kind = Kind.ALL, names: Container[str] | None = None
) -> Iterator[tuple[str, ast.Module]]:
    """Each mutant, and what was changed where, in words; of these functions, methods and tables alone."""
    for number, part in enumerate(ast.walk(tree)):
        if part is not tree if names is None else _name(part) not in names:
            continue
        whole = list(ast.walk(part))
        fallbacks = {id(one.values[-1]) for one in whole if isinstance(one, ast.BoolOp)}
        for place, node in enumerate(whole):
            if id(node) in fallbacks and isinstance(node, ast.Constant):
                continue  # for what is never None
            for change in _changes(node, kind):
                mutant = copy.deepcopy(tree)
                twin = list(ast.walk(list(ast.walk(mutant))[number]))[place]
                change(twin)
                where = f"line {getattr(node, 'lineno', '?')}: {ast.unparse(node)}"
                yield f"{where} → {ast.unparse(twin)}", ast.fix_missing_locations(mutant)


def names(tree: ast.Module) -> set[str]:
    """Of everything that can be changed alone."""
    return {name for node in ast.walk(tree) if (name := _name(node)) is not None}


def _name(node: ast.AST) -> str | None:
    if isinstance(node, ast.FunctionDef):
        return node.name
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return node.targets[0].id
    return None


def _changes(node: ast.AST, kind: Kind) -> Iterator[Change]:
    """What may be done to a twin of this node."""
    if Kind.DECISIONS in kind:
        yield from _decisions(node)
    if Kind.NUMBERS in kind:
        yield from _numbers(node)


def _decisions(node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.Compare():
            yield from _comparisons(node, NEIGHBOURS)
        case ast.BoolOp():
            yield _to("op", CONDITIONS[type(node.op)]())
        case ast.BinOp() if type(node.op) in SIGNS:
            yield _to("op", SIGNS[type(node.op)]())
        case ast.UnaryOp(op=ast.Not()):
            yield _to("operand", ast.UnaryOp(ast.Not(), copy.deepcopy(node.operand)))
        case ast.UnaryOp(op=ast.USub()):
            yield _to("op", ast.UAdd())


def _numbers(node: ast.AST) -> Iterator[Change]:
    match node:
        case ast.Compare():
            yield from _comparisons(node, OPPOSITES)
        case ast.BinOp() if type(node.op) in FACTORS:
            yield _to("op", FACTORS[type(node.op)]())
        case ast.Constant() if type(node.value) in (int, float):
            yield _to("value", node.value + 1)  # type: ignore[operator]
        case ast.Attribute() | ast.Name():
            field = "attr" if isinstance(node, ast.Attribute) else "id"
            for other in NAMES.get(getattr(node, field), ()):
                yield _to(field, other)


def _comparisons(node: ast.Compare, others: dict[type[ast.cmpop], type[ast.cmpop]]) -> Iterator[Change]:
    for place, op in enumerate(node.ops):
        if type(op) in others:
            ops = [*node.ops[:place], others[type(op)](), *node.ops[place + 1 :]]
            yield _to("ops", ops)


def _to(field: str, value: object) -> Change:
    return lambda twin: setattr(twin, field, value)
