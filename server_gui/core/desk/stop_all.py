"""What became of STOP ALL: one result of all robots, beside each robot's own, until all are reset."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

from gateway.amounts import counted
from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.texts import TEXTS
from server_gui.core.alarms.unconfirmed import remedy, silent_controllers, unconfirmed
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, StopState

NAMED: Final = 3  # robots that are named where there is little room
SENT: Final = Mark("half", "warn", "STOP ALL sent")
STOPPED: Final = Mark("triangle", "warn", "STOP ALL")


class Stopped(Protocol):
    """A robot that was stopped."""

    @property
    def title(self) -> str: ...

    @property
    def robot(self) -> Robot: ...

    @property
    def stopping(self) -> StopProgress: ...


@dataclass(frozen=True, slots=True)
class StopAllResult:
    """How it stands now, in a mark and in wordings for less and less room."""

    mark: Mark
    wordings: tuple[str, ...]


class StopAll:
    """The robots that STOP ALL was sent to; each counts as its own STOP says, the newest one."""

    def __init__(self, robots: Sequence[Stopped]) -> None:
        self._robots = list(robots)

    def look(self, still: Sequence[Stopped]) -> StopAllResult | None:
        """Return the result for those that the desk has `still`; None once every one of them is reset."""
        self._robots = [one for one in self._robots if one in still]
        left = [one for one in self._robots if not _is_reset(one)]
        return _result(self._robots, left) if left else None


def _result(robots: Sequence[Stopped], left: Sequence[Stopped]) -> StopAllResult:
    missing = [one for one in left if one.stopping.state is StopState.NOT_CONFIRMED]
    waiting = [one for one in left if one.stopping.state is StopState.SENT]
    stopped = len(left) - len(missing) - len(waiting)
    back = [one for one in robots if one not in left]
    count = f"{stopped} of {counted(len(robots), 'robot')} stopped"
    drives = _drives(robots, left)
    parts = [f"{count}, {drives}" if drives else count]
    parts += [f"{_named(back)} reset"] if back else []
    parts += [f"no answer yet from {_named(waiting)}"] if waiting else []
    words = dict.fromkeys(_word(one) for one in missing)
    brief = [f"{_named([one for one in missing if _word(one) == word])} {word}" for word in words]
    why = [_why(one) for one in missing]
    mark = SENT if waiting else STOPPED
    mark = Mark("square", "bad", mark.word) if missing else mark
    wordings = ("; ".join((*parts, *why)), "; ".join((*parts, *brief)), "; ".join((count, *brief)))
    return StopAllResult(mark, tuple(dict.fromkeys(f"{mark.word}: {said}" for said in wordings)))


def _drives(robots: Sequence[Stopped], left: Sequence[Stopped]) -> str:
    """Return `12/12 drives confirmed in 84 ms`: of the robots whose drives are known.

    Drives that were off before are counted apart: the time says nothing of them.
    """
    if not any(one.stopping.state in (StopState.CONFIRMED, StopState.NOT_CONFIRMED) for one in left):
        return ""
    confirmed = sum(len(one.stopping.confirmed) for one in left)
    known = [len(one.stopping.confirmed | set(one.robot.names("joint"))) for one in left]
    every = f"/{sum(known)}" if all(known) and len(left) == len(robots) else ""
    after_ms = [ms for one in left if (ms := one.stopping.slowest_ms) is not None]
    one_drive = confirmed == 1 and not every
    said = f"{confirmed}{every} {'drive' if one_drive else 'drives'} confirmed"
    if not confirmed:
        return said if every else ""
    off = sum(len(one.stopping.already_off) for one in left)
    if off and after_ms:
        were = "was" if off == 1 else "were"
        return f"{said}: {confirmed - off} stopped in {max(after_ms):.0f} ms, {off} {were} off before"
    return f"{said} in {max(after_ms):.0f} ms" if after_ms else f"{said}, already off"


def _why(one: Stopped) -> str:
    """Return whose STOP is not confirmed, why, and what to do."""
    why = silent_controllers(one.robot, one.stopping) or one.stopping.why
    return f"{one.title} {_word(one)}: {why} → {', '.join(remedy(one.robot, one.stopping))}"


def _word(one: Stopped) -> str:
    return TEXTS[unconfirmed(one.robot)].mark.word


def _named(robots: Sequence[Stopped]) -> str:
    names = [one.title for one in robots[:NAMED]]
    more = len(robots) - len(names)
    return ", ".join(names) + (f" and {more} more" if more else "")


def _is_reset(one: Stopped) -> bool:
    return one.stopping.state is StopState.IDLE and not one.stopping.held
