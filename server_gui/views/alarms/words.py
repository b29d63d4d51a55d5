"""An alarm in words: whose it is and what is wrong, since when, what follows from it, and what to check."""

import re
import time
from collections.abc import Iterable
from typing import Final

from ml.robot.task import ABNORMAL
from server_gui.core.alarms.alarm import ASIDE, MORE, Active, Alarm
from server_gui.core.alarms.marks import age_text
from server_gui.core.alarms.overload import ALSO
from server_gui.core.alarms.texts import UNSTOPPED, Kind
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import Recording
from server_gui.core.desk.station import Station
from server_gui.views.marks import Mark, time_of_day

Told = tuple[Station | None, Active]  # without a robot: of what this window records, or one it had
Key = tuple[str, tuple[Kind, str]]
BUSY: Final = "no alarms, but what is shown may be late: end other programs on this computer"
BREAK: Final = re.compile("[;,] ")  # between things to check
SINCE: Final = "since "
UNLIKE: Final = "abnormal: unlike all that the model has learned from; look at the wearer"
UNSEEN: Final = "of its signals; trouble of its buses is on the time axis"
BLAME: Final = re.compile(r"gwrms blame(?:, gwrms snapshot resource)?")
BLAME_PAGE: Final = "on the page Resources"
REMEDY: Final = "→"  # what there is to check, or to do


def key_of(told: Told) -> Key:
    station, one = told
    return "" if station is None else station.name, one.alarm.key


def gathered(desk: Desk) -> list[Told]:
    """Return every alarm: of robots that were removed, of the recording, then of each robot."""
    found: list[Told] = [(None, one) for of in (desk, desk.recording) for one in of.alarms.active]
    return found + [(station, one) for station in desk.stations for one in station.alarms.active]


def in_order(desk: Desk) -> list[Told]:
    """Return every alarm: what is bad, then of the robot that is looked at, the worst first.

    How to go on after a reset is what its user looks for next: only what is bad goes before.
    """
    selected = desk.selected
    return sorted(
        gathered(desk),
        key=lambda told: (
            told[1].is_acknowledged,
            told[1].alarm.kind not in UNSTOPPED,
            told[1].alarm.mark.colour != "bad",
            told[0] is not None and told[0] is not selected,
            told[1].alarm.kind is not Kind.RESET,
            told[1].alarm.rank,
            told[1].since_s,
        ),
    )


def quiet(station: Station | None, recording: Recording | None = None) -> tuple[Mark, str, str]:
    """Return that there is no alarm, where that is known."""
    if station is None:
        return Mark("ring", "dim"), "No robot", ""
    if station.robot.is_recording:
        return Mark("diamond", "accent"), "No alarm then", UNSEEN
    if not station.is_live or not station.robot.parts:
        return Mark("ring", "old"), "Alarms not known", "no live data"
    if station.mark.colour != "good":  # as its card says
        return station.mark, "No alarms", station.mark.word
    known = station.predictions
    if known.foresees and not (known.danger is not None and known.danger.is_known):
        return Mark("ring", "dim"), "No alarms", "danger is not known"
    if any(not told.is_stale() and told.prediction.label == ABNORMAL for told in known.told.values()):
        return Mark("triangle", "warn", ABNORMAL), "No alarms", UNLIKE
    if recording is not None and recording.can_ask and not recording.reach.is_known:
        return Mark("ring", "dim"), "No alarms", "the store is not known"
    if not station.robot.has_rate():
        return Mark("ring", "dim"), "No alarms", "its rate is not known yet"
    if station.is_full():
        return Mark("triangle", "warn", "busy"), "This computer is busy", BUSY
    return Mark("disc", "good"), "No alarms", "all ok"


def leading(told: Told, beside: Iterable[Told]) -> tuple[Mark, Told]:
    """Return the state that leads, and what is in it: the worst, as on the robot's card.

    A reset says how to go on, before warnings of its robot; it is not how that robot is.
    """
    station, one = told
    if station is None or one.alarm.kind is not Kind.RESET:
        return one.alarm.mark, told
    others = (each for each in beside if each[0] is station and each[1] is not one)
    return station.mark, min(others, key=lambda each: each[1].alarm.rank, default=told)


def going_on(told: Told, worse: Alarm, *, named: bool) -> tuple[str, ...]:
    """Return how to go on after a reset, and what else is wrong: neither is the other's cause or remedy."""
    station, one = told
    where = f"{worse.mark.word}: {worse.spoken}" if worse.spoken else worse.mark.word
    whose = f"{station.title} · " if station and named else ""
    first = f"{whose}{one.alarm.mark.word}: nothing moves until the drives are enabled"
    last = "" if worse.is_now else " (last known)"
    return tuple(f"{first} · also {also}{last}" for also in dict.fromkeys((worse.line, where)))


def headline(told: Told, *, named: bool, more: str = "", brief: int = 0) -> str:
    """Whose it is, what is wrong, and whether that is now; `brief` is 0 for all, to 3 for its cause alone."""
    station, one = told
    alarm = one.alarm
    said_of = (alarm.line, alarm.bare, alarm.brief, alarm.least)[brief]
    line = " · ".join(filter(None, (station.title if station and named else "", said_of)))
    marks = [more, "" if alarm.is_now else "last known", "acknowledged" if one.is_acknowledged else ""]
    said = ", ".join(filter(None, marks))
    return f"{line} ({said})" if said else line


def now_s(station: Station | None) -> float:
    """Return the instant that is shown, UTC."""
    return time.time() if station is None else station.robot.now_s()


def details(one: Active, now_s: float, *, each: bool = False) -> list[str]:
    """Since when (UTC) and what the robot did, what it explains (`each` in full), and what to check."""
    alarm = one.alarm
    first = f"{SINCE}{time_of_day(one.since_s)}, for {lasting(max(0.0, now_s - one.since_s))}"
    first = f"{first} · {alarm.why}" if alarm.why else first
    lines = [f"{first} · robot: {alarm.did}" if alarm.did else first]
    if alarm.under:
        lines += [f"with it: {under.line}" for under in alarm.under] if each else [alarm.consequences]
    return (
        [*lines, f"{REMEDY} {in_window(alarm.check)}"]
        if alarm.check and alarm.check not in alarm.what
        else lines
    )


def blames(alarm: Alarm) -> bool:
    """Return whether the page of the computer's resources shows what is to be checked."""
    return BLAME.search(alarm.check) is not None


def in_window(check: str) -> str:
    """Return what to check with this window's page for the command that shows the same in a terminal."""
    return BLAME.sub(BLAME_PAGE, check)


def fewer(said: list[str]) -> tuple[str, ...]:
    """Return the details as texts for less and less room: what to check stays longest, then the time."""
    since = said[0].partition(" · ")[0]
    began, check = since.partition(", for ")[0], [one for one in said[1:] if one.startswith(REMEDY)]
    bare = [ASIDE.sub("", one.partition(ALSO)[0]) for one in check]
    first = [f"{begun}{MORE}" for one in check for begun in _begun(one)]
    with_check = (
        said,
        [since, *said[1:]],
        [since, *check],
        [began, *check],
        [since, *bare],
        [began, *bare],
        check,
        bare,
        *([begin, one] for one in first for begin in (since, began)),
    )
    shorter: tuple[list[str], ...] = (*with_check, *([one] for one in first), [since], [])
    return tuple(dict.fromkeys(map(" · ".join, shorter)))


def _begun(check: str) -> list[str]:
    """Return what begins it, a word less each, down to its first clause: no room stays empty."""
    least, words = BREAK.split(check, maxsplit=1)[0], check.split(" ")
    begun = (" ".join(words[:count]).rstrip(",;") for count in range(len(words) - 1, 0, -1))
    return [one for one in dict.fromkeys(begun) if len(one) >= len(least)]


def lasting(for_s: float) -> str:
    """Return a time that grows, in whole seconds as long as these matter."""
    return f"{for_s:.0f} s" if for_s < 120 else age_text(for_s)
