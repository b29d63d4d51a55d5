"""The code that makes a recipe's features, as one hash: a model is useless once that computes otherwise."""

import ast
import functools
import hashlib
import importlib
import inspect
import sys
from collections.abc import Iterator
from importlib.metadata import version
from typing import Any, Final

from ml.features.recipe import Recipe
from ml.parsing import parsing

PACKAGES: Final = ("ml.features.", "ml.robot.")
_LIBRARIES: Final = ("scikit-learn", "numpy", "skops")


def features_hash(recipe: Recipe) -> str:
    """Return the hash of the recipe's numbers and of all our modules that compute its features.

    Comments, docstrings and layout do not count.
    """
    compute: Any = recipe.compute
    while isinstance(compute, functools.partial):
        compute = compute.func
    digest = hashlib.sha256(repr((recipe.name, recipe.rate_hz, recipe.look_back, recipe.channels)).encode())
    for name in sorted(_modules(compute.__module__, set())):
        digest.update(_digest(name))
    return digest.hexdigest()


def versions() -> dict[str, str]:
    """Return the versions of Python and the training libraries."""
    return {"python": ".".join(map(str, sys.version_info[:3]))} | {name: version(name) for name in _LIBRARIES}


def _modules(name: str, seen: set[str]) -> set[str]:
    """Return a module, those of ours that it imports, and so on."""
    seen.add(name)
    for found in _imports(name) - seen:
        _modules(found, seen)
    return seen


@functools.cache
def _imports(name: str) -> frozenset[str]:
    found = (node.module or "" for node in ast.walk(_tree(name)) if isinstance(node, ast.ImportFrom))
    return frozenset(module for module in found if module.startswith(PACKAGES))


@functools.cache
def _digest(name: str) -> bytes:
    return hashlib.sha256("\n".join((name, *_said(_tree(name)))).encode()).digest()


def _tree(name: str) -> ast.Module:
    source = inspect.getsource(importlib.import_module(name))
    return parsing(lambda: ast.parse(source))


def _said(node: Any) -> Iterator[str]:
    """Yield the code's content, the same in every version of Python.

    Without places, docstrings and what is not.
    """
    if isinstance(node, ast.AST):
        yield type(node).__name__
        for field, value in ast.iter_fields(node):
            if value is not None and value != []:
                yield field
                yield from _said(value)
    elif isinstance(node, list):
        yield from (word for each in node if not _is_text(each) for word in _said(each))
    else:
        yield repr(node)


def _is_text(node: Any) -> bool:
    """Return whether it is a docstring, or another string that nothing is done with."""
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )
