"""Puts a mistake back into the code under test: a module is loaded with some of its text replaced.

To be called before anything of the gateway is imported.
"""

import importlib.abc
import importlib.machinery
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from types import CodeType, ModuleType


@dataclass(frozen=True, slots=True)
class Part:
    """One text in one module, which must be there exactly once, and what stands in its place."""

    module: str
    old: str
    new: str


class _Loader(importlib.machinery.SourceFileLoader):
    """Compiles the changed text, past every cache."""

    parts: Sequence[Part] = ()

    def get_code(self, fullname: str) -> CodeType:
        path = self.get_filename(fullname)
        text = self.get_data(path).decode()
        for part in self.parts:
            if text.count(part.old) != 1:
                raise ImportError(f"{fullname} has {text.count(part.old)} times and not once: {part.old!r}")
            text = text.replace(part.old, part.new)
        return compile(text, path, "exec")


class _Finder(importlib.abc.MetaPathFinder):
    def __init__(self, parts: Sequence[Part]) -> None:
        self._parts = parts

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> importlib.machinery.ModuleSpec | None:
        parts = [part for part in self._parts if part.module == fullname]
        spec = importlib.machinery.PathFinder.find_spec(fullname, path) if parts else None
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(fullname, spec.origin)
            spec.loader.parts = parts
        return spec


def put_back(parts: Sequence[Part]) -> None:
    """From now on these modules are imported with their mistakes.

    Raises `RuntimeError` where it is too late for that.
    """
    for part in parts:
        if part.module in sys.modules:
            raise RuntimeError(f"{part.module} is imported already")
    sys.meta_path.insert(0, _Finder(parts))
