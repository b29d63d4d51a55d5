"""At which line of a TOML file a table or a key stands, for what is said of it."""

import re
import tomllib
from collections import Counter
from collections.abc import Iterator
from typing import Any, Final

from gateway.tables.finding import Finding

Path = tuple[str, ...]

_WHERE: Final = re.compile(r"\[+(?P<table>.*?)\]+(?: number (?P<number>\d+))?")
_LONGEST: Final = 400  # lines of one value


class Places:
    """Line numbers in a TOML file; of other files nothing is known."""

    def __init__(self, text: str) -> None:
        self._lines: dict[Path, int] = {}
        for path, line in _statements(text.splitlines()):
            for length in range(1, len(path) + 1):
                self._lines.setdefault(path[:length], line)

    def line(self, finding: Finding) -> int | None:
        """Return the line of the key, or else of its table; `None` if neither is in the file."""
        found = _WHERE.fullmatch(finding.where)
        if found is None and finding.where != "the file":
            return None
        table = (
            () if found is None else _table(found["table"]) + ((found["number"],) if found["number"] else ())
        )
        key = tuple(part for part in re.split(r"[.\[\]]", finding.key) if part)
        for length in range(len(key), -1, -1):
            line = self._lines.get((*table, *key[:length])) if length or table else None
            if line is not None:
                return line
        return None


def _table(written: str) -> Path:
    """Return a header's parts, also of one that is written without the quotes that it needs."""
    try:
        return _path(tomllib.loads(f"[{written}]"))
    except tomllib.TOMLDecodeError:
        head, _, name = written.partition(".")
        return (head, name) if name else (head,)


def _statements(lines: list[str]) -> Iterator[tuple[Path, int]]:
    """Each header and each key with its table, and the line where it begins; lists of tables are counted."""
    table: Path = ()
    counts: Counter[Path] = Counter()
    at = 0
    while at < len(lines):
        said, taken = _statement(lines[at : at + _LONGEST])
        if lines[at].lstrip().startswith("[") and said:
            table = _path(said)
            if lines[at].lstrip().startswith("[["):
                counts[table] += 1
                table = (*table, str(counts[table]))
            yield table, at + 1
        elif said:
            yield from (((*table, *path), at + 1) for path in _paths(said))
        at += taken


def _statement(lines: list[str]) -> tuple[dict[str, Any], int]:
    """Parse the first statement, with as many further lines as its value has."""
    if not lines[0].strip() or lines[0].lstrip().startswith("#"):
        return {}, 1
    for count in range(1, len(lines) + 1):
        try:
            return tomllib.loads("\n".join(lines[:count])), count
        except tomllib.TOMLDecodeError as error:
            if "end of document" not in str(error):
                break  # more lines mend nothing: it is within a value that is too long
    return {}, 1


def _path(said: dict[str, Any]) -> Path:
    """Return the one way down in a header alone."""
    path: Path = ()
    inner: Any = said
    while isinstance(inner, dict) and inner:
        (name,) = inner
        path, inner = (*path, name), inner[name]
        if isinstance(inner, list):
            break
    return path


def _paths(said: dict[str, Any], above: Path = ()) -> Iterator[Path]:
    for name, value in said.items():
        yield (*above, name)
        if isinstance(value, dict):
            yield from _paths(value, (*above, name))
