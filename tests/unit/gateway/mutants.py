"""Mutants of a module: its source with one comparison, condition or number turned into another one."""

import ast
import copy
import inspect
from collections.abc import Callable, Iterator
from types import ModuleType

OTHER_COMPARISONS: dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]] = {
    ast.Lt: (ast.LtE, ast.Gt),
    ast.LtE: (ast.Lt, ast.GtE),
    ast.Gt: (ast.GtE, ast.Lt),
    ast.GtE: (ast.Gt, ast.LtE),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
}
OTHER_NAMES = {"lt": ("le", "gt"), "gt": ("ge", "lt"), "min": ("max",), "max": ("min",)}
OTHER_CONDITIONS: dict[type[ast.boolop], type[ast.boolop]] = {ast.And: ast.Or, ast.Or: ast.And}
OTHER_OPERATORS: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}


class Mutant:
    """One of them; `where` is the line and what stands there instead."""

    def __init__(self, module: ModuleType, tree: ast.Module, where: str) -> None:
        self.where = where
        self._module = module
        self._tree = tree

    def load(self) -> ModuleType:
        """A module of its own, beside the sound one."""
        made = ModuleType(f"{self._module.__name__}_mutant")
        exec(compile(self._tree, str(self._module.__file__), "exec"), made.__dict__)
        return made


def mutants(module: ModuleType, *names: str) -> Iterator[Mutant]:
    """Every mutant of these functions, methods and tables of the module."""
    tree = ast.parse(inspect.getsource(module))
    wanted = [number for number, node in enumerate(ast.walk(tree)) if _name(node) in names]
    assert len(wanted) >= len(names), f"{module.__name__} no longer has all of {names}"
    for number in wanted:
        whole = list(ast.walk(list(ast.walk(tree))[number]))
        fallbacks = {id(one.values[-1]) for one in whole if isinstance(one, ast.BoolOp)}
        for place, node in enumerate(whole):
            if id(node) in fallbacks and isinstance(node, ast.Constant):
                continue  # for what is never None
            for change in _changes(node):
                copied = copy.deepcopy(tree)
                twin = list(ast.walk(list(ast.walk(copied))[number]))[place]
                change(twin)
                line = getattr(node, "lineno", 0)
                yield Mutant(module, copied, f"{module.__name__}:{line}: {ast.unparse(twin)}")


def _name(node: ast.AST) -> str | None:
    if isinstance(node, ast.FunctionDef):
        return node.name
    if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
        return node.targets[0].id
    return None


def _changes(node: ast.AST) -> Iterator[Callable[[ast.AST], None]]:
    """What may be done to a twin of this node."""
    if isinstance(node, ast.Compare):
        for place, op in enumerate(node.ops):
            for other in OTHER_COMPARISONS[type(op)]:
                yield lambda twin, place=place, other=other: twin.ops.__setitem__(place, other())  # type: ignore[misc]
    elif isinstance(node, ast.BoolOp):
        yield lambda twin: setattr(twin, "op", OTHER_CONDITIONS[type(twin.op)]())  # type: ignore[attr-defined]
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
        yield lambda twin: setattr(twin, "op", ast.UAdd())
    elif isinstance(node, ast.BinOp) and type(node.op) in OTHER_OPERATORS:
        yield lambda twin: setattr(twin, "op", OTHER_OPERATORS[type(twin.op)]())  # type: ignore[attr-defined]
    elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
        yield lambda twin: setattr(twin, "value", twin.value + 1)  # type: ignore[attr-defined]
    elif isinstance(node, ast.Attribute | ast.Name):
        field = "attr" if isinstance(node, ast.Attribute) else "id"
        for other_name in OTHER_NAMES.get(getattr(node, field), ()):
            yield lambda twin, field=field, name=other_name: setattr(twin, field, name)  # type: ignore[misc]
