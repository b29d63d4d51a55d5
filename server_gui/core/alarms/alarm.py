"""An active alarm: what is wrong, where, since when, what the robot did, and what to check."""

import dataclasses
import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.texts import TEXTS, UNSTOPPED, Kind

HOTTER: Final = 10  # °C: so much more is to be read again
NEWER_S: Final = 1.0  # a stop that is so much later is another one, to be read again
ASIDE: Final = re.compile(r" \([^()]*\)$")
GRAVER: Final = {Kind.PART_STALE: "component silent", Kind.STALLED: "computer halted"}
MORE: Final = " …"  # there is more, which stands in the list
SHORT: Final = 100  # letters that have room on a card


@dataclass(frozen=True, slots=True)
class Alarm:
    """One thing that is wrong; `key` stays the same while it lasts.

    `since_s` is UTC, None while only its first sight is known. `channel` is what shows it, `clears` is true
    where a fault reset may help.
    """

    kind: Kind
    subject: str  # a component, a rule, a bus; empty: the robot
    what: str
    where: str = ""
    did: str = ""
    check: str = ""
    since_s: float | None = None
    channel: str | None = None
    clears: bool = False
    is_now: bool = True  # else it is what was last known
    node: str = ""  # the bus of what is a node
    under: "tuple[Alarm, ...]" = ()  # what it explains
    aside: str = ""  # said only where there is room for all
    word: str = ""  # another one than its kind's, of the same meaning
    grade: int = 0  # its code, or how bad it is: where that is another, or worse, it is to be read again
    why: str = ""  # more of the cause, below the line: what is to be done stands in it

    @property
    def key(self) -> tuple[Kind, str]:
        """What tells it from others."""
        return self.kind, self.subject

    @property
    def mark(self) -> Mark:
        """How it is shown, wherever that is: as bad as the worst that it explains, and one word for each.

        Parts that are lost are counted in it: `computer halted, 6 lost`.
        """
        own = TEXTS[self.kind].mark
        if self.word:
            return dataclasses.replace(own, word=self.word)
        worst = min((self, *self.under), key=lambda one: _RANK[one.kind])
        shown = TEXTS[worst.kind].mark
        if shown.colour == own.colour:
            return own
        lost = sum(one.kind is Kind.LOST for one in self.under)
        word = GRAVER.get(self.kind, own.word)
        return Mark(shown.shape, shown.colour, f"{word}, {lost} lost" if lost else word)

    @property
    def rank(self) -> int:
        """The less the worse."""
        return min(_RANK[one.kind] for one in (self, *self.under))

    @property
    def consequences(self) -> str:
        """What it explains, by kind: `unreliable: left hip, right knee; stale: gait`."""
        names: dict[str, list[str]] = {}
        for one in self.under:
            names.setdefault(one.mark.word, []).append(one.spoken or one.what)
        return "; ".join(f"{word}: {', '.join(found)}" for word, found in names.items())

    @property
    def spoken(self) -> str:
        """What it is about, for people."""
        return self.where.partition(",")[0] or self.subject.replace("_", " ")

    @property
    def line(self) -> str:
        """Cause first: `fault: left knee: 0x2310 continuous overcurrent at the output`."""
        return self._said("; ".join(filter(None, (self.what, self.aside))))

    @property
    def bare(self) -> str:
        """The line without what is said in brackets at its end: the list has it."""
        return self._said(ASIDE.sub("", self.what))

    @property
    def brief(self) -> str:
        """The line where there is little room: of several reasons the first, and that there are more."""
        first, more, _ = self.what.partition("; ")
        return self._said(f"{first}{MORE}" if more and len(self.what) > SHORT else self.what)

    @property
    def least(self) -> str:
        """The line with the cause alone, where what to check needs the room: the list has all of it."""
        first = ASIDE.sub("", self.what.partition("; ")[0])
        return self._said(self.what if first == self.what else f"{first}{MORE}")

    def _said(self, what: str) -> str:
        return ": ".join(filter(None, (self.mark.word, self.where or self.subject.replace("_", " "), what)))


@dataclass(frozen=True, slots=True)
class Active:
    """An alarm that was seen at `since_s` (UTC) first; `at_ns` is that instant on the axis of the signals."""

    alarm: Alarm
    since_s: float
    at_ns: int | None = None
    is_acknowledged: bool = False


Gather = Callable[[Iterable[Active]], Iterable[Active]]


class Alarms:
    """The alarms of one robot, worst first and in each kind the oldest; `revision` rises with each change."""

    def __init__(self) -> None:
        self.revision = 0
        self._active: dict[tuple[Kind, str], Active] = {}
        self._shown: tuple[Active, ...] = ()

    @property
    def active(self) -> Sequence[Active]:
        """What lasts, not acknowledged first."""
        return self._shown

    @property
    def worst(self) -> Alarm | None:
        """The worst of the robot itself, acknowledged or not: that it is known does not make it better."""
        of_robot = (one.alarm for one in self._shown if one.alarm.kind not in _NOT_ITS_STATE)
        return min(of_robot, key=lambda alarm: alarm.rank, default=None)

    @property
    def each(self) -> Sequence[Alarm]:
        """Every one, also what another explains."""
        return [alarm for one in self._shown for alarm in (one.alarm, *one.alarm.under)]

    def look(
        self,
        found: Iterable[Alarm],
        now_s: float,
        newest_ns: int | None = None,
        gather: Gather = list,
    ) -> None:
        """Take what is wrong now (UTC); `newest_ns` is the newest row, on the axis of the signals.

        `gather` puts what has one cause under it.
        """
        before = self._active
        self._active = {alarm.key: _kept(before.get(alarm.key), alarm, now_s, newest_ns) for alarm in found}
        self._show(gather(self._active.values()))

    def forget_places(self) -> None:
        """Forget where they began on the axis of the signals, which begins anew."""
        self._active = {key: dataclasses.replace(one, at_ns=None) for key, one in self._active.items()}
        self._show(dataclasses.replace(one, at_ns=None) for one in self._shown)

    def acknowledge(self, key: tuple[Kind, str]) -> None:
        """Note that somebody has read it, and what it explains; it is shown smaller until it is over."""
        read = {key} | {under.key for one in self._shown if one.alarm.key == key for under in one.alarm.under}
        for each in read & self._active.keys():
            self._active[each] = dataclasses.replace(self._active[each], is_acknowledged=True)
        self._show(
            dataclasses.replace(one, is_acknowledged=True) if one.alarm.key == key else one
            for one in self._shown
        )

    def _show(self, shown: Iterable[Active]) -> None:
        before, self._shown = self._shown, tuple(sorted(shown, key=_order))
        if self._shown != before:
            self.revision += 1


def _kept(before: Active | None, alarm: Alarm, now_s: float, newest_ns: int | None) -> Active:
    """Return the same alarm as before, or a new one; what has become worse is to be read again."""
    if before is None:
        since_s = now_s if alarm.since_s is None else alarm.since_s
        at_ns = None if newest_ns is None else newest_ns - round(max(0.0, now_s - since_s) * 1e9)
        return Active(alarm, since_s, at_ns)
    if alarm.kind in _OF_STOP and alarm.since_s is not None:
        is_read = before.is_acknowledged and alarm.since_s <= before.since_s + NEWER_S
        return dataclasses.replace(before, alarm=alarm, since_s=alarm.since_s, is_acknowledged=is_read)
    if alarm.kind is Kind.STALE and alarm.since_s is not None and alarm.since_s > before.since_s:
        return dataclasses.replace(before, alarm=alarm, since_s=alarm.since_s, at_ns=newest_ns)
    grade, is_read = _graded(before, alarm)
    alarm = dataclasses.replace(alarm, grade=grade)
    return dataclasses.replace(before, alarm=alarm, is_acknowledged=is_read)


def _graded(before: Active, alarm: Alarm) -> tuple[int, bool]:
    """Return its code, or the heat that was read last or is the most, and whether it stays read."""
    was, now = before.alarm.grade, alarm.grade
    if alarm.kind is not Kind.HOT:
        return now or was, before.is_acknowledged and now in (0, was)  # 0: not known
    if before.is_acknowledged and now < was + HOTTER:
        return was, True
    return max(now, was), False


def _order(one: Active) -> tuple[bool, int, float]:
    return one.is_acknowledged, one.alarm.rank, one.since_s


_RANK = {kind: place for place, kind in enumerate(Kind)}
_OF_STOP = UNSTOPPED | {Kind.STOPPED, Kind.RESET}
_NOT_ITS_STATE = frozenset({Kind.RESET})
