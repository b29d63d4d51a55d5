"""Reading TOML tables with errors that name the file, the table, the key and what is allowed."""

import math
from collections.abc import Collection, Mapping
from typing import Any

from hil_sim.errors import SimulatorError


class ScenarioError(SimulatorError):
    """A scenario file cannot be used; the message names file, table and key."""


class Table:
    """One table of a file; `where` is how errors call it."""

    def __init__(self, where: str, values: object) -> None:
        self.where = where
        if not isinstance(values, Mapping):
            raise ScenarioError(f"{where}: this must be a table")
        self.values: Mapping[str, Any] = values

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def fail(self, what: str) -> ScenarioError:
        return ScenarioError(f"{self.where}: {what}")

    def only(self, allowed: Collection[str]) -> None:
        """Raises where there is a key that is not allowed."""
        for key in self.values:
            if key not in allowed:
                raise self.fail(f"there is no key {key!r}; allowed are {', '.join(sorted(allowed))}")

    def one_of(self, keys: Collection[str]) -> str:
        """Return the one of these keys that is there; raises where there is none, or more."""
        found = [key for key in keys if key in self.values]
        if len(found) != 1:
            raise self.fail(f"give exactly one of {', '.join(keys)}, not {' and '.join(found) or 'none'}")
        return found[0]

    def seconds(self, key: str) -> float:
        return self._seconds(key, self.values.get(key))

    def window(self, key: str) -> tuple[float, float]:
        """Two times, the first one not after the second."""
        values = self.values[key]
        if not isinstance(values, list) or len(values) != 2:
            raise self.fail(f"{key} = {values!r} is no window: give two times, like [4, 6.5]")
        begin_s, end_s = (self._seconds(key, value) for value in values)
        if begin_s > end_s:
            raise self.fail(f"{key} = {values!r} ends before it begins")
        return begin_s, end_s

    def text(self, key: str, default: str | None = None) -> str:
        value = self.values.get(key, default)
        if not isinstance(value, str):
            raise self.fail(f"{key} = {value!r} must be a text")
        return value

    def choice(self, key: str, allowed: Collection[str], default: str) -> str:
        value = self.text(key, default)
        if value not in allowed:
            raise self.fail(f"{key} = {value!r} is not possible; allowed are {', '.join(allowed)}")
        return value

    def number(self, key: str) -> float:
        value = self.values[key]
        if not _is_number(value):
            raise self.fail(f"{key} = {value!r} must be a number")
        return float(value)

    def whole(self, key: str, default: int) -> int:
        value = self.values.get(key, default)
        if not isinstance(value, int) or isinstance(value, bool):
            raise self.fail(f"{key} = {value!r} must be a whole number")
        return value

    def flag(self, key: str) -> bool:
        value = self.values[key]
        if not isinstance(value, bool):
            raise self.fail(f"{key} = {value!r} must be true or false")
        return value

    def _seconds(self, key: str, value: object) -> float:
        if not isinstance(value, int | float) or not _is_number(value) or value < 0:
            raise self.fail(f"{key} = {value!r} is no time: give seconds since the robot was switched on")
        return float(value)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
