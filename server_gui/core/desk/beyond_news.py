"""Events of values that have gone beyond their limits: one as each alarm begins."""

from collections.abc import Callable, Iterable
from typing import Final

from server_gui.core.alarms.alarm import Active
from server_gui.core.alarms.texts import OF_VALUES, Kind
from server_gui.core.follow.news import NewsKind

NEWS_OF: Final = {Kind.FALLEN: NewsKind.FAULT, Kind.BEYOND: NewsKind.FAULT, Kind.HOT: NewsKind.WARNING}


class BeyondNews:
    """`tell` hears of each, with what it is about."""

    def __init__(self, tell: Callable[[NewsKind, str, str], None]) -> None:
        self._tell = tell
        self._told: frozenset[tuple[Kind, str]] = frozenset()

    def look(self, active: Iterable[Active]) -> None:
        """Take what is wrong now."""
        found = {one.alarm.key: one.alarm for one in active if one.alarm.kind in OF_VALUES}
        for kind in OF_VALUES:
            new = [alarm for key, alarm in found.items() if alarm.kind is kind and key not in self._told]
            what = new[0].what if len(new) == 1 else kind.value
            if new:
                names, about = ", ".join(one.spoken for one in new), new[0].subject if len(new) == 1 else ""
                self._tell(NEWS_OF[kind], f"{names}: {what}", about)
        self._told = frozenset(found)
