"""Events of what only alarms tell: values beyond their limits, and buses that fail or are full."""

from collections.abc import Callable, Iterable
from typing import Final

from server_gui.core.alarms.alarm import Active, Alarm
from server_gui.core.alarms.texts import OF_VALUES, Kind
from server_gui.core.follow.news import NewsKind

NEWS_OF: Final = {
    Kind.FALLEN: NewsKind.FAULT,
    Kind.BEYOND: NewsKind.FAULT,
    Kind.HOT: NewsKind.WARNING,
    Kind.BUS_FAILS: NewsKind.FAULT,
    Kind.BUS_FULL: NewsKind.FAULT,
}


class AlarmNews:
    """`tell` hears of each, with what it is about."""

    def __init__(self, tell: Callable[[NewsKind, str, str], None]) -> None:
        self._tell = tell
        self._told: frozenset[tuple[Kind, str]] = frozenset()

    def look(self, active: Iterable[Active]) -> None:
        """Take what is wrong now."""
        found = {one.alarm.key: one.alarm for one in active if one.alarm.kind in NEWS_OF}
        for kind, news in NEWS_OF.items():
            new = [alarm for key, alarm in found.items() if alarm.kind is kind and key not in self._told]
            if new:
                names, about = ", ".join(one.spoken for one in new), new[0].subject if len(new) == 1 else ""
                self._tell(news, f"{names}: {_what(new)}", about)
        self._told = frozenset(found)


def _what(new: list[Alarm]) -> str:
    """Return what is wrong; of several the kind alone."""
    kind = new[0].kind
    if len(new) > 1:
        return kind.value
    return new[0].what if kind in OF_VALUES else f"{kind.value}: {new[0].what}"
