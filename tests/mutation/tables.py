"""Mutants of tables that protect people: every entry is changed, and the table's check must notice.

A check is a function from tables to complaints: none for the product's own, at least one for each mutant.
What no check notices could be wrong in the product too.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

K = TypeVar("K")
V = TypeVar("V")
T = TypeVar("T")


@dataclass(frozen=True)
class Mutant(Generic[T]):
    """A table with one change, in words."""

    change: str
    table: T

    def __str__(self) -> str:
        return self.change


def mapping_mutants(name: str, table: Mapping[K, V], values: Iterable[V]) -> Iterator[Mutant[dict[K, V]]]:
    """Each entry with each other value, and without it."""
    others = tuple(values)
    for key, held in table.items():
        yield Mutant(f"{name} without {key!r}", {one: value for one, value in table.items() if one != key})
        for value in others:
            if value != held:
                yield Mutant(f"{name}[{key!r}] = {value!r}", {**table, key: value})


def added_mutants(
    name: str, table: Mapping[K, V], keys: Iterable[K], values: Iterable[V]
) -> Iterator[Mutant[dict[K, V]]]:
    """An entry that must not be there."""
    others = tuple(values)
    for key in keys:
        if key not in table:
            for value in others:
                yield Mutant(f"{name} with {key!r}: {value!r}", {**table, key: value})


def set_mutants(name: str, members: frozenset[K], universe: Iterable[K]) -> Iterator[Mutant[frozenset[K]]]:
    """Each member left out, and each other one added."""
    for one in universe:
        change = "without" if one in members else "with"
        yield Mutant(f"{name} {change} {one!r}", members ^ {one})


def unnoticed(check: Callable[[Any], Iterable[str]], mutants: Iterable[Mutant[T]]) -> list[str]:
    """Which mutants the check does not complain about; fails where there are none to try."""
    tried = list(mutants)
    assert tried, "there is nothing to mutate"
    return [str(mutant) for mutant in tried if next(iter(check(mutant.table)), None) is None]
