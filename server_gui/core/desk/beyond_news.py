"""Events of values that have gone beyond their limits: one as each alarm begins."""

from collections.abc import Callable, Iterable

from server_gui.core.alarms.alarm import Active
from server_gui.core.alarms.texts import OF_VALUES, Kind
from server_gui.core.follow.news import NewsKind


class BeyondNews:
    """`tell` hears of each, with what it is about."""

    def __init__(self, tell: Callable[[NewsKind, str, str], None]) -> None:
        self._tell = tell
        self._told: frozenset[tuple[Kind, str]] = frozenset()

    def look(self, active: Iterable[Active]) -> None:
        """Take what is wrong now."""
        found = {one.alarm.key: one.alarm for one in active if one.alarm.kind in OF_VALUES}
        for key in found.keys() - self._told:
            self._tell(NewsKind.WARNING, f"{found[key].spoken}: {found[key].what}", found[key].subject)
        self._told = frozenset(found)
