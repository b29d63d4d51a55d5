"""Rows of a device's objects, the values to compare with, and all read values as a table."""

import datetime
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from gateway.units import with_minus
from gateway.wire.dictionary import ObjectInfo
from gateway.wire.method import Number
from gateway.wire.object_search import fitting
from server_gui.core.objects.forms import is_other, place
from server_gui.core.objects.objects import Dictionary
from server_gui.core.objects.reading import Object, ReadValue

CSV_TITLES: Final = (
    "component",
    "object",
    "name",
    "type",
    "access",
    "value",
    "words",
    "utc",
    "compared_with",
    "other",
    "differs",
    "default",
    "min",
    "max",
    "unit",
    "pdos",
    "parameter",
    "problem",
)
BY_EDS: Final = "EDS default"


class RowKind(Enum):
    """Filter of a device's objects."""

    ALL = "All"
    PARAMETERS = "Parameters"
    DIFFERENT = "≠"
    PINNED = "★"


@dataclass(frozen=True, slots=True)
class Compared:
    """One device's objects beside another device's, or, without one, beside the defaults of its own EDS."""

    component: str
    held: Mapping[Object, ReadValue]
    with_component: str | None = None

    @property
    def title(self) -> str:
        return BY_EDS if self.with_component is None else self.with_component.replace("_", " ")

    def value(self, info: ObjectInfo) -> Number | str | None:
        """Return the device's value as of the last read; None if unknown."""
        return _value(self.held.get((self.component, info.object)))

    def other(self, info: ObjectInfo) -> Number | str | None:
        """Return the value to compare with."""
        if self.with_component is None:
            return info.default
        return _value(self.held.get((self.with_component, info.object)))

    def differs(self, info: ObjectInfo) -> bool:
        """Return whether both are known, and are not the same."""
        return is_other(self.value(info), self.other(info))


def pin_of(component: str, address: str) -> str:
    """Return the name by which an object is pinned: its address, as commands take it."""
    return f"{component}.{address}"


class Finder:
    """Finds what is shown of thousands of objects; what has not changed is not looked for again."""

    def __init__(self) -> None:
        self._index: tuple[object, list[tuple[int, int, str]]] = (None, [])
        self._fitting: tuple[object, list[ObjectInfo]] = (None, [])
        self._found: tuple[object, Mapping[RowKind, list[ObjectInfo]]] = (None, {})

    def find(
        self, dictionary: Dictionary, words: str, compared: Compared, pinned: Collection[str], revision: int
    ) -> Mapping[RowKind, list[ObjectInfo]]:
        """Return those that the words mean, of every kind; `revision` rises with what was read."""
        listed = (compared.component, dictionary, dictionary.revision)
        fitted = (*listed, words)
        found = (*fitted, compared.with_component, frozenset(pinned), revision)
        if self._index[0] != listed:
            self._index = listed, [(*place(one.object), _text(one)) for one in dictionary.objects]
        if self._fitting[0] != fitted:
            fits = fitting(words)
            pairs = zip(dictionary.objects, self._index[1], strict=True)
            self._fitting = fitted, [info for info, where in pairs if fits(*where)]
        if self._found[0] != found:
            self._found = found, _by_kind(self._fitting[1], compared, pinned)
        return self._found[1]


def _by_kind(
    objects: list[ObjectInfo], compared: Compared, pinned: Collection[str]
) -> Mapping[RowKind, list[ObjectInfo]]:
    return {
        RowKind.ALL: objects,
        RowKind.PARAMETERS: [info for info in objects if info.read_only is None],
        RowKind.DIFFERENT: [info for info in objects if compared.differs(info)],
        RowKind.PINNED: [info for info in objects if pin_of(compared.component, info.object) in pinned],
    }


def limits(info: ObjectInfo) -> str:
    """Return the smallest and largest value by the EDS; empty where it names none."""
    low, high = ("" if one is None else with_minus(str(one)) for one in (info.min, info.max))
    return f"{low} … {high}" if low or high else ""


def channel_lines(component: str, info: ObjectInfo) -> str:
    """Return the lines of robot.toml that make it a channel, which is recorded and drawn."""
    name = re.sub(r"[^a-z0-9]+", "_", info.name.rpartition(".")[2].lower()).strip("_") or "object"
    unit = f'\nunit = "{info.unit}"' if re.fullmatch(r'[^"\\]+', info.unit) else ""
    return f'[channel."{component}.{name}"]\nobject = "{info.object}"{unit}'


def cells(objects: Sequence[ObjectInfo], compared: Compared) -> Iterator[tuple[object, ...]]:
    """Yield the lines under `CSV_TITLES`, of what was read."""
    for info in objects:
        held = compared.held.get((compared.component, info.object))
        if held is None:
            continue
        read = datetime.datetime.fromtimestamp(held.utc_s, datetime.UTC)
        values = (compared.value(info), compared.other(info), info.default, info.min, info.max)
        value, other, default, low, high = ("" if one is None else one for one in values)
        yield (
            compared.component,
            info.object,
            info.name,
            info.type,
            info.access,
            value,
            held.told.words,
            read.isoformat(timespec="milliseconds"),
            compared.title,
            other,
            "yes" if compared.differs(info) else "",
            default,
            low,
            high,
            info.unit,
            " ".join(info.pdos),
            info.parameter or "",
            held.told.problem or "",
        )


def _value(held: ReadValue | None) -> Number | str | None:
    return None if held is None or held.told.problem is not None else held.told.value


def _text(info: ObjectInfo) -> str:
    """Return all that words may be of."""
    parts = (info.object, info.name, info.type, info.access, info.unit, *info.pdos, info.parameter or "")
    return " ".join(parts)
