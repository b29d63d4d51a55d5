"""What became of STOP ALL: one result of all robots, beside each robot's own, until all are reset."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final, Protocol

from gateway.amounts import counted
from server_gui.core.alarms.drive_states import is_live, listed, unknown_joints
from server_gui.core.alarms.marks import Mark
from server_gui.core.alarms.texts import TEXTS, Kind
from server_gui.core.alarms.unconfirmed import (
    STOP_AGAIN,
    enabled_again,
    remedy,
    silent_controllers,
    unconfirmed,
)
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.stop import StopProgress, StopState

NAMED: Final = 3  # robots that are named where there is little room
SENT: Final = Mark("half", "warn", "STOP ALL sent")
STOPPED: Final = Mark("triangle", "warn", "STOP ALL")
AS_FAR: Final = "confirmed it, as far as is known"


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


class How(Enum):
    """How a robot stands after a STOP ALL."""

    STOPPED = "confirmed, held, and nothing that was seen since speaks against it"
    RESET = "no stop is held any more, by anybody's reset"
    WAITING = "no answer yet"
    OLD = "confirmed, and not seen of late"
    NOT_STOPPED = "not confirmed, or not held, or enabled again"


@dataclass(frozen=True, slots=True)
class Standing:
    """How one robot stands, in words for little room and for more; none where all is well, or it is asked."""

    title: str
    how: How
    brief: str = ""
    why: str = ""


class StopAll:
    """The robots that STOP ALL was sent to; each counts as its own STOP says, the newest one.

    One that is removed before it was confirmed, or seen to have stopped, stays named until the next STOP ALL.
    """

    def __init__(self, robots: Sequence[Stopped]) -> None:
        self._robots = list(robots)
        self._removed: list[Standing] = []

    def remove(self, robot: Stopped) -> None:
        """Look at it no more: to be called while it can still be seen how it stands."""
        if robot not in self._robots:
            return
        self._robots.remove(robot)
        standing = _standing(robot)
        if standing.how in (How.WAITING, How.OLD, How.NOT_STOPPED):
            self._removed.append(_removed(standing))

    def look(self) -> StopAllResult | None:
        """Return the result; None once every robot is reset."""
        standings = [_standing(one) for one in self._robots]
        every = [*standings, *self._removed]
        if all(one.how is How.RESET for one in every):
            return None
        return _result(every, _drives(self._robots, every))


def _standing(one: Stopped) -> Standing:
    """Return how a robot stands: it has stopped only where that is confirmed, and seen to be so still."""
    state = one.stopping.state
    if state is StopState.NOT_CONFIRMED:
        return _unconfirmed(one)
    if state is StopState.SENT:
        return Standing(one.title, How.WAITING)
    if state is StopState.IDLE:
        return _held_by_another(one) if one.stopping.held else Standing(one.title, How.RESET)
    return _confirmed(one)


def _unconfirmed(one: Stopped) -> Standing:
    """Return whose STOP is not confirmed, why, and what to do."""
    word = TEXTS[unconfirmed(one.robot)].mark.word
    why = silent_controllers(one.robot, one.stopping) or one.stopping.why
    return _not_stopped(one, word, why, remedy(one.robot, one.stopping))


def _held_by_another(one: Stopped) -> Standing:
    """Return that ours was reset, and another stop is held, of whose drives nobody here knows."""
    by = f" ({one.stopping.reason})" if one.stopping.reason else ""
    return _not_stopped(
        one, "HELD BY ANOTHER STOP", f"ours was reset, nobody here saw that one confirmed{by}"
    )


def _confirmed(one: Stopped) -> Standing:
    if one.stopping.is_let_go:
        word = TEXTS[Kind.NOT_HELD].mark.word
        return _not_stopped(one, word, "it was confirmed, and is held no more")
    if not is_live(one.robot):
        link = "no live values" if one.robot.is_linked else "no link"
        brief = f"{AS_FAR}: {link}"
        return Standing(one.title, How.OLD, brief, f"{brief}, what its drives do now is not known")
    if not one.robot.is_newer_than(one.stopping.answered_ns):
        return Standing(one.title, How.STOPPED)  # the drives' own answer is the newest that is known
    if again := enabled_again(one.robot, one.stopping):
        to_do = remedy(one.robot, one.stopping)
        return _not_stopped(one, TEXTS[Kind.ENABLED_AGAIN].mark.word, listed(again), to_do)
    if unknown := unknown_joints(one.robot):
        brief = f"{AS_FAR}: state not known"
        return Standing(one.title, How.OLD, brief, f"{brief} of {listed(unknown)}")
    return Standing(one.title, How.STOPPED)


def _not_stopped(
    one: Stopped, word: str, why: str, to_do: Sequence[str] = (STOP_AGAIN, "or use the hardware stop")
) -> Standing:
    return Standing(one.title, How.NOT_STOPPED, word, f"{word}: {why} → {', '.join(to_do)}")


def _removed(standing: Standing) -> Standing:
    """Return how one stands that nobody sees any more: never better than it was."""
    if standing.how is How.OLD:
        why = f"{standing.why}; removed from this window → look at the robot itself"
        return replace(standing, brief=f"removed, {standing.brief}", why=why)
    word = TEXTS[Kind.NOT_STOPPED].mark.word
    before = f"last seen {standing.brief}" if standing.brief else "before it answered"
    why = f"{word}: removed from this window, {before} → use the hardware stop"
    return replace(standing, how=How.NOT_STOPPED, brief=f"removed, {word}", why=why)


def _result(robots: Sequence[Standing], drives: str) -> StopAllResult:
    by_how = {how: [one for one in robots if one.how is how] for how in How}
    doubtful, waiting, back = [one for one in robots if one.why], by_how[How.WAITING], by_how[How.RESET]
    count = f"{len(by_how[How.STOPPED])} of {counted(len(robots), 'robot')} stopped"
    parts = [f"{count}, {drives}" if drives else count]
    parts += [f"{_named(back)} reset"] if back else []
    parts += [f"no answer yet from {_named(waiting)}"] if waiting else []
    words = dict.fromkeys(one.brief for one in doubtful)
    brief = [f"{_named([one for one in doubtful if one.brief == word])} {word}" for word in words]
    why = [f"{one.title} {one.why}" for one in doubtful]
    mark = SENT if waiting else STOPPED
    mark = Mark("square", "bad", mark.word) if by_how[How.NOT_STOPPED] else mark
    worst_first = sorted(doubtful, key=lambda one: one.how is not How.NOT_STOPPED)
    said = Counter(one.brief for one in worst_first)
    least = "; ".join((*(f"{number} {word}" for word, number in said.items()), count))  # whatever their names
    wordings = ("; ".join((*parts, *why)), "; ".join((*parts, *brief)), "; ".join((count, *brief)), least)
    return StopAllResult(mark, tuple(dict.fromkeys(f"{mark.word}: {said}" for said in wordings)))


def _drives(robots: Sequence[Stopped], standings: Sequence[Standing]) -> str:
    """Return `12/12 drives confirmed in 84 ms`: of the robots whose drives are known.

    Drives that were off before are counted apart: the time says nothing of them. What a robot confirmed that
    has not stayed stopped counts no more.
    """
    told = [one.stopping for one, how in zip(robots, standings, strict=False) if _counts(one, how)]
    if not told:
        return ""
    confirmed = sum(len(one.confirmed) for one in told)
    known = [len(one.stopping.confirmed | set(one.robot.names("joint"))) for one in robots]
    is_whole = all(known) and len(robots) == len(standings)  # else one is removed
    is_whole = is_whole and all(one.how is not How.RESET for one in standings)
    every = f"/{sum(known)}" if is_whole else ""
    after_ms = [ms for one in told if (ms := one.slowest_ms) is not None]
    one_drive = confirmed == 1 and not every
    said = f"{confirmed}{every} {'drive' if one_drive else 'drives'} confirmed"
    if not confirmed:
        return said if every else ""
    off = sum(len(one.already_off) for one in told)
    if off and after_ms:
        were = "was" if off == 1 else "were"
        return f"{said}: {confirmed - off} stopped in {max(after_ms):.0f} ms, {off} {were} off before"
    return f"{said} in {max(after_ms):.0f} ms" if after_ms else f"{said}, already off"


def _counts(one: Stopped, standing: Standing) -> bool:
    return standing.how in (How.STOPPED, How.OLD) or one.stopping.state is StopState.NOT_CONFIRMED


def _named(robots: Sequence[Standing]) -> str:
    names = [one.title for one in robots[:NAMED]]
    more = len(robots) - len(names)
    return ", ".join(names) + (f" and {more} more" if more else "")
