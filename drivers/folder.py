"""A folder of formats: every module in it is one, by its file's name, and is imported when it is used."""

import importlib
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib.machinery import PathFinder
from typing import TypeVar

F = TypeVar("F")

_NAME = re.compile(r"[a-z][a-z0-9-]*")


class Folder(Mapping[str, F]):
    """The formats in `package` by name: `bno08x-rvc` is the `FORMAT` of its module `bno08x_rvc`.

    To ask for a name imports nothing, to get one imports that one, to go through all of them imports all.
    """

    def __init__(self, package: str) -> None:
        self._package = package

    def __contains__(self, name: object) -> bool:
        if not isinstance(name, str) or _NAME.fullmatch(name) is None:
            return False
        return PathFinder.find_spec(self._module(name), self._path) is not None

    def __getitem__(self, name: str) -> F:
        if name not in self:
            raise KeyError(name)
        found: F = importlib.import_module(self._module(name)).FORMAT
        return found

    def __iter__(self) -> Iterator[str]:
        import pkgutil  # for who lists them only

        names = sorted(module.name for module in pkgutil.iter_modules(self._path))
        return (name.replace("_", "-") for name in names)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    @property
    def _path(self) -> list[str]:
        return list(importlib.import_module(self._package).__path__)

    def _module(self, name: str) -> str:
        return f"{self._package}.{name.replace('-', '_')}"


def not_a_format(name: str, known: Iterable[str]) -> str:
    """Return the message for a key `format` that names none of these."""
    import difflib  # for who has mistyped only

    names = list(known)
    close = difflib.get_close_matches(name, names, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"format {name!r} is not known: {hint}allowed are {', '.join(names)}"
