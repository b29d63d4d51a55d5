"""Asks before a stop is ended or a fault cleared, and says what that does and how to go on."""

from collections.abc import Callable, Iterator, Sequence

from PySide6.QtWidgets import QWidget

from gateway.wire.stop import ROBOT_RESET
from server_gui.core.alarms.drive_states import listed, unknown_joints
from server_gui.core.alarms.marks import ENABLED
from server_gui.core.alarms.stop_alarms import go_on
from server_gui.core.alarms.texts import Kind
from server_gui.core.alarms.unconfirmed import enabled_again, remedy, silent_controllers
from server_gui.core.desk.station import Station
from server_gui.views.confirmation import Question, Watched, ask

DOES = "Every drive is led to “switch on disabled”. None is enabled, and this moves nothing."


def ask_reset(parent: QWidget, station: Station, watched: Sequence[Watched] = ()) -> Question:
    """Ask whether a held stop is to be ended, beside what is watched meanwhile."""
    why = station.stopping.reason
    held = f"Reset the stop of {station.title}?{f' It is held: {why}.' if why else ''}"
    held = f"{_unstopped(station)}{held}"
    text = f"{held}\n\n{DOES}\n\nAfterwards, {go_on(Kind.RESET, station.robot)}."
    return _asked(parent, f"Reset the stop of {station.title}", text, "Reset stop", station, watched)


def _unstopped(station: Station) -> str:
    """Return first that it has not stopped, or is enabled again, and what to do: a reset is no answer."""
    first = ", ".join(remedy(station.robot, station.stopping))
    if again := enabled_again(station.robot, station.stopping):
        return f"ENABLED AGAIN: {listed(again)}. First {first}.\n\n"
    if not station.stopping.is_unproven:
        return ""
    why = silent_controllers(station.robot, station.stopping) or station.stopping.why
    return f"STOP NOT CONFIRMED: {why}. First {first}.\n\n"


def ask_clear(parent: QWidget, station: Station, watched: Sequence[Watched] = ()) -> Question:
    """Ask whether faults are to be cleared: what is enabled loses its torque by it."""

    def failed(why: str) -> None:
        _ask_again(parent, station, why, watched)

    more = f"\n\n{states}" if (states := _states(station)) else ""
    held = "\n\nThe STOP that is held ends with it." if station.stopping.held else ""
    check = go_on(Kind.RESET, station.robot)
    asked = "\n".join((f"Clear the fault of {station.title}?", *_faults(station)))
    text = f"{asked}\n\n{DOES}{more}{held}\n\nAfterwards, {check}."
    title = f"Clear the fault of {station.title}"
    return _asked(parent, title, text, "Clear fault", station, watched, failed)


def _faults(station: Station) -> Iterator[str]:
    """Yield each fault that would be cleared: the question lies over what else says it."""
    for alarm in station.alarms.each:
        if alarm.kind in (Kind.FAULT, Kind.REPORTS) and alarm.what:
            yield f"{alarm.spoken}: {alarm.what}"


def _states(station: Station) -> str:
    """Return which drives lose their torque, as far as is known; empty where all are known to be off."""
    joints, age_s = station.robot.names("joint"), station.robot.age_s()
    enabled = [joint for joint in joints if station.robot.word(f"{joint}.state") == ENABLED]
    names = ", ".join(joint.replace("_", " ") for joint in enabled)
    if station.is_live:
        return f"STILL ENABLED, and without torque then: {names}. Hold the wearer first." if enabled else ""
    if not station.is_linked or age_s is None:
        return "What its drives do now is not known: any that is enabled loses its torque."
    then = f"enabled then: {names}" if enabled else "none was enabled then"
    old = f"When you asked, its drives' states were {age_s:.1f} s old"
    return f"{old}: {then}. Any that is enabled loses its torque."


def _ask_again(parent: QWidget, station: Station, why: str, watched: Sequence[Watched]) -> None:
    """Report that the fault is still there: no success, even though no stop is held."""

    def again() -> None:
        ask_clear(parent, station, watched)

    def is_moot() -> bool:
        in_fault = any(alarm.kind is Kind.FAULT for alarm in station.alarms.each)
        return station.is_live and not in_fault and not unknown_joints(station.robot)

    title = f"NOT cleared: the fault of {station.title}"
    ask(parent, title, f"{why}.", "Clear fault again …", again, watched=watched, is_moot=is_moot)


def _asked(
    parent: QWidget,
    title: str,
    text: str,
    action: str,
    station: Station,
    watched: Sequence[Watched],
    failed: Callable[[str], None] = lambda _: None,
) -> Question:
    """With no way to do what this desk may not."""
    why_not = station.refused(ROBOT_RESET)
    said = f"{why_not}.\n\n{text}" if why_not else text
    question = ask(parent, title, said, action, lambda: station.reset(failed), watched=watched)
    question.act.setEnabled(not why_not)
    return question
