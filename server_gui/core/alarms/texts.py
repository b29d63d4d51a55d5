"""The table of everything that can be wrong: how it is marked, and what to check."""

from dataclasses import dataclass
from enum import Enum
from typing import Final

from drivers.error_codes import error_check, error_text
from server_gui.core.alarms.marks import Mark

__all__ = ["TEXTS", "Kind", "Text", "check_of", "error_check", "error_text"]


class Kind(Enum):
    """What sort of thing is wrong; the worst comes first."""

    STILL_MOVING = "STILL MOVING"  # after a STOP that is not confirmed
    ENABLED_AGAIN = "ENABLED AGAIN"  # while a stop is held
    NOT_HELD = "STOP NOT HELD"  # it was confirmed
    NOT_STOPPED = "STOP NOT CONFIRMED"
    LEFT_UNSTOPPED = "removed, not stopped"  # from this window, before its STOP was confirmed
    ANOTHER = "ANOTHER ROBOT ANSWERS"
    NEVER_REACHED = "never reached"
    NO_LINK = "no link"
    FAULT = "fault"
    FALLEN = "fallen?"
    GUARD = "guard tripped"
    BEYOND = "beyond its ends"
    DANGER = "danger foreseen"
    IMPLAUSIBLE = "unreliable"
    LOST = "lost"
    NO_DATA = "no data yet"
    STALE = "stale"
    HOT = "hot"
    BUS_FAILS = "bus fails"
    BUS_FULL = "bus full"
    NOT_RECORDED = "not recorded"
    LEFT_RUNNING = "removed"  # from this window, and it may be enabled
    STOPPED = "STOPPED"
    PART_STALE = "component stale"
    STALLED = "computer paused"
    UNKNOWN = "state not known"
    BUS_BUSY = "bus busy"
    BLIND = "guard blind"
    DANGER_ADVICE = "danger possible"
    RECORDING = "recording"
    UPLOAD = "store"
    BUS = "bus trouble"
    REPORTS = "warning"
    RESET = "stop reset"


LEFT: Final = frozenset({Kind.LEFT_UNSTOPPED, Kind.LEFT_RUNNING})
OF_VALUES: Final = frozenset({Kind.FALLEN, Kind.BEYOND, Kind.HOT})
UNSTOPPED: Final = frozenset({Kind.STILL_MOVING, Kind.ENABLED_AGAIN, Kind.NOT_HELD, Kind.NOT_STOPPED})


@dataclass(frozen=True, slots=True)
class Text:
    """How a kind is marked, and what to check where nothing better is known."""

    mark: Mark
    check: str


def _text(kind: Kind, shape: str, colour: str, check: str) -> tuple[Kind, Text]:
    return kind, Text(Mark(shape, colour, kind.value), check)


_ENABLE: Final = "enable the drives (gwrms enable, or the robot's controller)"
# Where only the controller may: the gateway is an observer.
_START: Final = "enable the drives: start the robot's controller again"
_ADD: Final = "add it again to see and stop it, or use the hardware stop"
RESET_BUTTON: Final = "“Reset stop…”"  # of the window
TEXTS: Final = dict(
    (
        _text(Kind.STILL_MOVING, "square", "bad", "STOP again, or use the hardware stop"),
        _text(Kind.ENABLED_AGAIN, "square", "bad", "STOP again, or use the hardware stop"),
        _text(Kind.NOT_HELD, "square", "bad", "STOP again, or use the hardware stop"),
        _text(Kind.NOT_STOPPED, "square", "bad", "use the hardware stop"),
        _text(Kind.LEFT_UNSTOPPED, "square", "bad", _ADD),
        _text(Kind.LEFT_RUNNING, "triangle", "warn", _ADD),
        _text(
            Kind.ANOTHER,
            "square",
            "bad",
            "do not trust what answers there; compare its key on the robot's own screen (gwrms keys list)",
        ),
        _text(
            Kind.NEVER_REACHED,
            "cross",
            "bad",
            "is the robot switched on, its gateway running (gwrms gateway), and the address right?",
        ),
        _text(
            Kind.NO_LINK,
            "cross",
            "bad",
            "look at the robot itself; check its power, network and gateway",
        ),
        _text(Kind.NO_DATA, "ring", "old", "it takes a few seconds; else look whether its devices answer"),
        _text(
            Kind.STALE,
            "triangle",
            "warn",
            "check the network's load, and what keeps the robot's computer busy",
        ),
        _text(
            Kind.FAULT, "square", "bad", "look into the drive's manual; note what the joint did just before"
        ),
        _text(
            Kind.FALLEN,
            "square",
            "bad",
            "look at the wearer now; if nobody has fallen, check how the IMU is mounted and its axes",
        ),
        _text(
            Kind.BEYOND,
            "square",
            "bad",
            "look at the joint now, STOP if in doubt; check its zero, its encoder and the ends (607Dh)",
        ),
        _text(
            Kind.HOT,
            "triangle",
            "warn",
            "do not touch it; let it cool, then check its load, its friction and its cooling",
        ),
        _text(
            Kind.GUARD,
            "square",
            "bad",
            "find out why before the stop is reset; the rule's limit is in its file",
        ),
        _text(
            Kind.DANGER,
            "square",
            "bad",
            "look at the wearer now, STOP if in doubt; it is on trial, and may be wrong (gwrms docs danger)",
        ),
        _text(
            Kind.DANGER_ADVICE,
            "triangle",
            "warn",
            "look at the wearer and the robot; it is on trial, and may be wrong (gwrms docs danger)",
        ),
        _text(Kind.IMPLAUSIBLE, "square", "bad", "look its code up in the device's manual; check its cable"),
        _text(Kind.LOST, "cross", "bad", "check its power, its cable and its address"),
        _text(
            Kind.STOPPED,
            "triangle",
            "warn",
            f"to go on: {RESET_BUTTON} once nobody is in danger; then {_ENABLE}",
        ),
        _text(Kind.PART_STALE, "triangle", "warn", "check its power, and its cable or radio"),
        _text(
            Kind.STALLED,
            "triangle",
            "warn",
            "see what keeps the robot's computer busy (gwrms describe); nothing was measured meanwhile",
        ),
        _text(
            Kind.UNKNOWN,
            "ring",
            "old",
            "the robot says of it what this window does not know: update the window",
        ),
        _text(Kind.BUS_FULL, "square", "bad", "find what sends so much; send less"),
        _text(Kind.BUS_BUSY, "triangle", "warn", "find what sends so much; send less"),
        _text(Kind.BUS, "triangle", "warn", "check termination, wiring, bitrate and load (gwrms describe)"),
        _text(
            Kind.BUS_FAILS, "square", "bad", "check termination, wiring, bitrate and load (gwrms describe)"
        ),
        _text(
            Kind.NOT_RECORDED,
            "square",
            "bad",
            "see to this computer's disk and load; what comes until then may be lost",
        ),
        _text(Kind.RECORDING, "triangle", "warn", "see to the disk of the spool (gwrms collect --status)"),
        _text(Kind.UPLOAD, "triangle", "warn", "what is recorded waits in the spool; check the store"),
        _text(
            Kind.BLIND, "triangle", "warn", "the guard does not see what it is to watch: check that component"
        ),
        _text(Kind.REPORTS, "triangle", "warn", "look into the device's manual"),
        _text(
            Kind.RESET,
            "ring",
            "dim",
            f"to go on: {_ENABLE}",
        ),
    )
)

# By what sort of component is not there, or silent.
_CHECKS: Final = {
    (Kind.LOST, "joint"): "check the drive's power, its CAN cable and its node id",
    (Kind.LOST, "insole"): "check that it is switched on and charged, its plug or its radio",
    (Kind.LOST, "imu"): "check its power, its plug and its port",
    (Kind.PART_STALE, "joint"): "check the drive's CAN cable, and the bus's load and errors (gwrms describe)",
    (Kind.PART_STALE, "insole"): "check its plug or radio, and its battery",
    (Kind.PART_STALE, "imu"): "check its plug, its cable and its rate",
    (Kind.IMPLAUSIBLE, "joint"): "check the encoder and its cable; home the joint again",
    (Kind.IMPLAUSIBLE, "insole"): "check how it lies in the shoe, and zero it unloaded",
    (Kind.IMPLAUSIBLE, "imu"): "check that it sits firmly, and its axes",
}


def check_of(kind: Kind, component: str = "", role: str | None = None, *, start_by: str = "") -> str:
    """Return what to check, by the kind of component too, and by the gateway's role on the bus.

    `start_by` is what starts the controller of this very robot, where that is known: of our simulator.
    """
    check = _CHECKS.get((kind, component), TEXTS[kind].check)
    return (
        check.replace(_ENABLE, f"{_START} ({start_by})" if start_by else _START)
        if role == "observer"
        else check
    )
