"""Mistakes and unlikely values in a file: table and key, the allowed and the likely intended value."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any


class Severity(StrEnum):
    """Severity of a finding."""

    MISTAKE = "mistake"  # the file is refused
    WARNING = "warning"  # it can be used, and is likely not what was meant, or something is not there yet


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing; `where` is the table as the file writes it, `[[rules]] number 2` for an entry of a list."""

    where: str
    key: str  # empty where it is the table itself, as both are for the whole file
    text: str
    severity: Severity = Severity.MISTAKE
    line: int | None = None  # in the file, where that was looked for

    @property
    def words(self) -> str:
        place = " ".join(filter(None, [self.where, self.key]))
        return f"{place}: {self.text}" if place else self.text


def warning(where: str, key: str, text: str) -> Finding:
    return Finding(where, key, text, Severity.WARNING)


Told = tuple[str, str, str, str]  # severity, where, key and text: how houses tell each other


def told(findings: Iterable[Finding]) -> Iterator[Told]:
    return ((one.severity.value, one.where, one.key, one.text) for one in findings)


def mistakes(findings: Iterable[Finding]) -> list[Finding]:
    """Return those for which the file is refused."""
    return [one for one in findings if one.severity is Severity.MISTAKE]


def in_order(findings: Iterable[Finding], document: Mapping[str, Any]) -> list[Finding]:
    """Return it as the tables stand in the file; what is of no table comes first."""
    tables = list(document)

    def place(one: Finding) -> tuple[int, int]:
        table, _, name = one.where.partition("]")[0].lstrip("[").partition(".")
        entries = document.get(table)
        names = list(entries) if isinstance(entries, Mapping) else []
        return _index(tables, table), _index(names, name.strip('"'))

    return sorted(findings, key=place)


def _index(names: list[str], name: str) -> int:
    return names.index(name) if name in names else -1


def lines(file: Path, findings: Iterable[Finding]) -> str:
    """Return a line each, which begins with the file."""
    return "\n".join(f"{file}: {one.words}" for one in findings)


def meant(word: object, allowed: Iterable[str], cutoff: float = 0.6) -> str:
    """`did you mean 'x'? `, where one of those that are allowed is close."""
    import difflib  # for who has mistyped only

    close = difflib.get_close_matches(str(word), [str(one) for one in allowed], 1, cutoff)
    return f"did you mean {close[0]!r}? " if close else ""


def unknown(word: object, allowed: Iterable[object]) -> str:
    """Return the words for something that is none of these."""
    names = [str(one) for one in allowed]
    return f"{word!r} is not known: {meant(word, names)}allowed are {', '.join(names)}"
