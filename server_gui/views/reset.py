"""Asks before a stop is ended or a fault cleared, and says what that does and how to go on."""

from PySide6.QtWidgets import QWidget

from server_gui.core.alarms.found import ENABLED
from server_gui.core.alarms.texts import Kind, check_of
from server_gui.core.desk.station import Station
from server_gui.views.ask import Question, ask

DOES = "Every drive is led to “switch on disabled”. None is enabled, and nothing moves by it."


def ask_reset(parent: QWidget, station: Station) -> Question:
    """Ask whether a held stop is to be ended."""
    why = station.stopping.reason
    held = f"The STOP of {station.title} is held{f': {why}' if why else ''}."
    text = f"{held}\n\n{DOES}\n\nAfterwards, {check_of(Kind.RESET)}"
    return ask(parent, f"Reset the stop of {station.title}", text, "Reset stop", station.reset)


def ask_clear(parent: QWidget, station: Station) -> Question:
    """Ask whether faults are to be cleared: what is enabled loses its torque by it."""
    joints = station.robot.names("joint")
    enabled = [joint for joint in joints if station.robot.word(f"{joint}.state") == ENABLED]
    if not station.is_live:
        more = "\n\nWhat its drives do now is not known: any that is enabled loses its torque."
    elif enabled:
        names = ", ".join(joint.replace("_", " ") for joint in enabled)
        more = f"\n\nSTILL ENABLED, and without torque then: {names}. Hold the wearer first."
    else:
        more = ""
    held = "\n\nThe STOP that is held ends with it." if station.stopping.held else ""
    text = f"Clear the fault of {station.title}?\n\n{DOES}{more}{held}\n\nAfterwards, {check_of(Kind.RESET)}"
    return ask(parent, f"Clear the fault of {station.title}", text, "Clear fault", station.reset)
