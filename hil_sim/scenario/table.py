"""Reading TOML tables: what is wrong is kept and told all at once, with table, key and what is allowed."""

import difflib
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from hil_sim.errors import SimulatorError


class ScenarioError(SimulatorError):
    """A scenario file cannot be used; the message names file, table and key, a line for each mistake."""


class Unusable(Exception):
    """An unusable table; the reason is among the mistakes."""


@dataclass(frozen=True, slots=True)
class Mistake:
    """One thing that is wrong, or likely is; `key` is empty where it is the table itself."""

    where: str
    key: str
    text: str
    severity: str = "mistake"  # or "warning": it can be run

    @property
    def words(self) -> str:
        place = " ".join(filter(None, [self.where, self.key]))
        return f"{place}: {self.text}" if place else self.text


class Table:
    """One table of a file; `where` is how mistakes call it. What is wrong counts as if it were not there."""

    def __init__(self, where: str, values: object, mistakes: list[Mistake]) -> None:
        self.where = where
        self.mistakes = mistakes
        if not isinstance(values, Mapping):
            raise self.unusable("this must be a table")
        self.values: Mapping[str, Any] = values

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def complain(self, key: str, text: str) -> None:
        self.mistakes.append(Mistake(self.where, key, text))

    def warn(self, key: str, text: str) -> None:
        self.mistakes.append(Mistake(self.where, key, text, "warning"))

    def unusable(self, text: str, key: str = "") -> Unusable:
        """Complain, and end with this table."""
        self.complain(key, text)
        return Unusable(text)

    def only(self, allowed: Collection[str]) -> None:
        """Complain about every key that is not allowed."""
        for key in self.values:
            if key not in allowed:
                known = ", ".join(sorted(allowed))
                self.complain(key, f"is not known: {meant(key, allowed)}allowed are {known}")

    def one_of(self, keys: Collection[str]) -> str:
        """Return the one of these keys that is there; raises `Unusable` where there is none, or more."""
        found = [key for key in keys if key in self.values]
        if len(found) != 1:
            said = " and ".join(found) or "none"
            raise self.unusable(f"give exactly one of {', '.join(keys)}, not {said}")
        return found[0]

    def seconds(self, key: str) -> float:
        if key not in self.values:
            self.complain(key, "is missing: give seconds since the robot was switched on")
            return 0.0
        return self._seconds(key, self.values[key])

    def window(self, key: str) -> tuple[float, float]:
        """Two times, the first one not after the second."""
        values = self.values[key]
        if not isinstance(values, list) or len(values) != 2:
            self.complain(key, f"{values!r} is no window: give two times, like [4, 6.5]")
            return 0.0, 0.0
        begin_s, end_s = (self._seconds(key, value) for value in values)
        if begin_s > end_s:
            self.complain(key, f"{values!r} ends before it begins")
        return begin_s, end_s

    def text(self, key: str, default: str = "") -> str:
        value = self.values.get(key, default)
        if not isinstance(value, str):
            self.complain(key, f"{value!r} must be a text")
            return default
        return value

    def table(self, key: str) -> Mapping[str, Any]:
        value = self.values.get(key, {})
        if not isinstance(value, Mapping):
            self.complain(key, f"{value!r} must be a table")
            return {}
        return value

    def choice(self, key: str, allowed: Collection[str], default: str) -> str:
        value = self.text(key, default)
        if value not in allowed:
            self.complain(key, unknown(value, allowed))
            return default
        return value

    def number(self, key: str) -> float:
        value = self.values[key]
        if not is_number(value):
            self.complain(key, f"{value!r} must be a number")
            return math.nan
        return float(value)

    def whole(self, key: str, default: int, least: int | None = None) -> int:
        value = self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            self.complain(key, f"{value!r} must be a whole number")
            return default
        if least is not None and value < least:
            self.complain(key, f"{value} must be {least} or more")
            return default
        return value

    def flag(self, key: str) -> bool:
        value = self.values[key]
        if not isinstance(value, bool):
            self.complain(key, f"{value!r} must be true or false")
        return value is True

    def _seconds(self, key: str, value: object) -> float:
        if not isinstance(value, int | float) or not is_number(value) or value < 0:
            self.complain(key, f"{value!r} is no time: give seconds since the robot was switched on")
            return 0.0
        return float(value)


def meant(word: str, allowed: Iterable[str]) -> str:
    """`did you mean 'x'? `, where one of those that are allowed is close."""
    close = difflib.get_close_matches(word, [str(one) for one in allowed], n=1)
    return f"did you mean {close[0]!r}? " if close else ""


def unknown(word: str, allowed: Collection[str]) -> str:
    """Return the words for something that is none of these."""
    return f"{word!r} is not known: {meant(word, allowed)}allowed are {', '.join(allowed)}"


def is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
