"""One cause, one alarm: what follows from a computer that stood still, or a node that has gone, is under it.

What is told under another alarm is neither hidden nor better for it: the one above has the worst mark of
both, names all of it, and is over when all of it is. A part that is lost stands under a stall only where the
stall explains it, and is counted in its word then.
"""

import dataclasses
import re
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Final

from server_gui.core.alarms.alarm import Active, Alarm
from server_gui.core.alarms.overload import is_common, is_unplugged
from server_gui.core.alarms.texts import Kind, check_of

LATE_S: Final = 0.2  # without a row: so long is enough to miss heartbeats and PDOs
STOOD_S: Final = 0.5  # so long is told also where nothing is wrong after it
AT_ONCE: Final = 0.6  # of it, that the rows are of which then come in one piece
CATCHES_UP_S: Final = 1.0  # a gateway sends what it is late with only as far back
BEFORE_S: Final = 0.5  # clocks, and looks at a robot, are no more exact
AFTER_S: Final = 5.0  # and then something is found to have missed its time
NEWS_TIMES: Final = 2.0  # as long as the longest before it: the others are in the alarm
EPISODE_S: Final = 60.0  # between two stalls that are told as one
TOLD_S: Final = 10.0  # how long a stall is told after which nothing was wrong
OWN_S: Final = 30.0  # what lasts longer than that after a stall is not the stall's
SUBJECT: Final = "computer"
# What a stall makes look wrong; a lost part where half of all are late (`is_common`), as a load does, and
# nothing whose port is gone. A drive in fault, a guard's stop and the link stand for themselves.
_OF_STALL: Final = frozenset(
    {Kind.IMPLAUSIBLE, Kind.LOST, Kind.PART_STALE, Kind.BUS, Kind.BUS_FAILS, Kind.BLIND, Kind.REPORTS}
)
_GONE: Final = frozenset({Kind.LOST, Kind.PART_STALE})
_OF_GONE: Final = frozenset({Kind.IMPLAUSIBLE, Kind.REPORTS, Kind.FAULT})
# CiA 301 §7.2.7.1: the heartbeat, or the PDOs, of another node did not come.
_MISSED: Final = re.compile(r"0x(8130|8250)\b", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Stall:
    """That the robot's gateway took nothing for so long; `began_s` is UTC."""

    began_s: float
    lasted_s: float

    @property
    def ended_s(self) -> float:
        return self.began_s + self.lasted_s


class Stalls:
    """Found in the rows of a stream: a gateway that stood still sends at once what it did not send meanwhile.

    A network, or a desk, that stood still brings the same rows in as many pieces as ever.
    """

    def __init__(self) -> None:
        self.latest: tuple[Stall, ...] = ()  # those that are told as one, oldest first
        self._before: tuple[int, int, int] | None = None  # stream, newest stamp, when it came
        self._known: deque[Stall] = deque(maxlen=32)

    def is_news(self, stall: Stall) -> bool:
        """Return whether to tell it: it is long, and far longer than those told with it before."""
        told = (one.lasted_s for one in self.latest[:-1] if one.lasted_s >= STOOD_S)
        before = max(told, default=0.0)
        return stall.lasted_s >= max(STOOD_S, NEWS_TIMES * before)

    def forget(self) -> None:
        """Forget the past at another link: what lies between is not the gateway's."""
        self._before = None

    def take(
        self, stream: int, stamps_ns: Sequence[int], received_ns: int, received_s: float
    ) -> Stall | None:
        """Take the stamps of rows that came at an instant (UTC in `received_s`); return what they show."""
        if not stamps_ns:
            return None
        before, self._before = self._before, (stream, stamps_ns[-1], received_ns)
        if before is None or before[0] != stream or stamps_ns[0] <= before[1]:
            return None
        silent_s, span_s = (received_ns - before[2]) / 1e9, (stamps_ns[-1] - stamps_ns[0]) / 1e9
        if silent_s < LATE_S or span_s < AT_ONCE * min(silent_s, CATCHES_UP_S):
            return None
        stall = Stall(received_s - silent_s, silent_s)
        if self._known and stall.began_s - self._known[-1].ended_s > EPISODE_S:
            self._known.clear()
        self._known.append(stall)
        self.latest = tuple(self._known)
        return stall


def stood_still(stalls: Sequence[Stall]) -> Iterator[Alarm]:
    """Yield the alarm that the robot's computer stood still."""
    if not stalls:
        return
    longest = max(stall.lasted_s for stall in stalls)
    times = "" if len(stalls) == 1 else f"{len(stalls)} times, for up to "
    what = f"the robot's computer stood still {times or 'for '}{longest:.1f} s"
    check = check_of(Kind.STALLED)
    yield Alarm(Kind.STALLED, SUBJECT, what, check=check, since_s=stalls[0].began_s)


def gathered(active: Iterable[Active], stalls: Sequence[Stall], now_s: float, parts: int) -> list[Active]:
    """Return the alarms of a robot with so many parts, those that another explains under that one."""
    known = list(active)
    of_stall = _of_stalls(known, stalls, now_s)
    if not is_common((one.alarm for one in of_stall), parts):
        of_stall = [one for one in of_stall if one.alarm.kind is not Kind.LOST]
    gone = [one for one in known if one.alarm.kind in _GONE and one.alarm.node]
    stood = next((one for one in known if one.alarm.kind is Kind.STALLED), None)
    under: dict[tuple[Kind, str], list[Active]] = {}
    for one in known:
        cause = _cause(one, gone, stood, of_stall)
        if cause is not None:
            under.setdefault(cause.alarm.key, []).append(one)
    explained = {one.alarm.key for found in under.values() for one in found}
    return [
        _above(one, under.get(one.alarm.key, []))
        for one in known
        if one.alarm.key not in explained and not (one is stood and not _is_told(one, under, stalls, now_s))
    ]


def _cause(
    one: Active, gone: Sequence[Active], stood: Active | None, of_stall: Sequence[Active]
) -> Active | None:
    """Return the alarm that explains this one.

    That of a stall before that of a node, which may be the stall's.
    """
    if stood is not None and one in of_stall:
        return stood
    alone = [cause for cause in gone if stood is None or cause not in of_stall]
    return next((cause for cause in alone if _is_of_node(one, cause)), None)


def _of_stalls(known: Sequence[Active], stalls: Sequence[Stall], now_s: float) -> list[Active]:
    """Return what began with a stall and may be its own."""
    return [
        one
        for one in known
        if one.alarm.kind in _OF_STALL
        and not is_unplugged(one.alarm)
        and any(
            stall.began_s - BEFORE_S <= one.since_s <= stall.ended_s + AFTER_S
            and now_s <= stall.ended_s + OWN_S
            for stall in stalls
        )
    ]


def _is_of_node(one: Active, cause: Active) -> bool:
    """Others miss a node's heartbeat, and its bus sees that it does not answer."""
    if one is cause or one.since_s < cause.since_s - AFTER_S:
        return False
    if one.alarm.kind is Kind.BUS:
        return one.alarm.subject == f"bus.{cause.alarm.node}"
    return one.alarm.kind in _OF_GONE and _MISSED.search(one.alarm.what) is not None


def _is_told(
    stood: Active, under: dict[tuple[Kind, str], list[Active]], stalls: Sequence[Stall], now_s: float
) -> bool:
    long = [stall for stall in stalls if stall.lasted_s >= STOOD_S]
    return stood.alarm.key in under or any(now_s <= stall.ended_s + TOLD_S for stall in long)


def _above(one: Active, under: Sequence[Active]) -> Active:
    """Return it with the alarms that it explains; read only when all of them are."""
    if not under:
        return one
    alarm = dataclasses.replace(
        one.alarm,
        under=tuple(each.alarm for each in under),
        clears=one.alarm.clears or any(each.alarm.clears for each in under),
    )
    read = one.is_acknowledged and all(each.is_acknowledged for each in under)
    return dataclasses.replace(one, alarm=alarm, is_acknowledged=read)
