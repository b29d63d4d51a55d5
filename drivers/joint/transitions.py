"""Leads one axis from state to state: down to SWITCH ON DISABLED, or up, one transition at a time.

Each step is taken from the state that the statusword says, and counts only when it says the next one. A stop
ends either way: nothing is sent any more, and nothing is tried again.
"""

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

from drivers.bus.sdo.channel import Interrupted
from drivers.error_codes import error_check, error_text
from drivers.errors import DeviceTimeout, DriverError, Unavailable
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import WAY_DOWN, WAY_UP
from drivers.joint.setpoint import hold_still

LOOK_S = 0.01  # between two looks at the statusword
FAULT_RESET_S = 0.5  # between two attempts to reset a fault that stays
STANDS_S, STANDS_SHARE = 0.05, 1e-4  # an axis that moves less than this share of a turn in this time stands
OVERTAKEN = "a stop came in between"
_UNKNOWN = "no state of CiA 402"
_WAY_UP_STATES = (*WAY_UP, DriveState.OPERATION_ENABLED)


@dataclass(frozen=True, slots=True)
class Led:
    """Result of leading an axis: its last state by the statusword, and the reason for not getting further."""

    state: DriveState | None
    problem: str | None = None
    mode: int | None = None  # of operation (6061h), where it was enabled
    # When the request was begun whose answer says the state (monotonic); 0: nothing was read.
    asked_ns: int = field(default=0, compare=False)


@dataclass(frozen=True, slots=True)
class Errand:
    """Parameters of a way up or down; `wanted` turns false when a stop has overtaken it."""

    wanted: Callable[[], bool]
    timeout_s: float
    counts_per_turn: float  # of the joint
    still_in: Collection[
        int
    ] = ()  # modes of operation that move nothing before a bit of the controlword rises


def look(axis: Axis) -> Led:
    """Return the state by its statusword; without an answer, the reason."""
    try:
        return _read(axis)
    except DriverError as error:
        return Led(None, str(error))


def lead_down(axis: Axis, errand: Errand) -> Led:
    """Lead to SWITCH ON DISABLED from any state; an axis that drives or brakes comes to rest before."""
    led = _Descent(axis, errand).run()
    if led.state is DriveState.FAULT and led.problem is not None and errand.wanted():
        led = replace(led, problem=f"{led.problem}: {_why_in_fault(axis)}, then reset it again")
    return _unless_overtaken(errand, led)


def _why_in_fault(axis: Axis) -> str:
    """Return its error code in words, and what to do."""
    try:
        code = axis.error_code()
    except DriverError:
        code = 0
    return f"{error_text(code)}; {error_check(code)}" if code else "it tells no code; remove what causes it"


def step_up(axis: Axis, errand: Errand, origin: DriveState) -> Led:
    """Lead from `origin` to the next state; an axis that is further up already is left as it is."""
    if not errand.wanted():
        return Led(None, OVERTAKEN)
    try:
        return _unless_overtaken(errand, _step_up(axis, errand, origin))
    except Interrupted:
        return Led(None, OVERTAKEN)
    except DriverError as error:
        return _unless_overtaken(errand, Led(None, str(error)))


def _unless_overtaken(errand: Errand, led: Led) -> Led:
    return led if errand.wanted() else replace(led, problem=OVERTAKEN)


def _read(axis: Axis) -> Led:
    asked_ns = time.monotonic_ns()
    state = axis.state()
    return Led(state, None if state is not None else f"it is in {_UNKNOWN}", asked_ns=asked_ns)


class _Descent:
    """One way down; looks again and again until it has arrived, its time is over, or it is not wanted."""

    def __init__(self, axis: Axis, errand: Errand) -> None:
        self._axis = axis
        self._errand = errand
        self._led = Led(None, "it does not answer")
        self._fault_reset_s = 0.0  # when the next may be tried

    def run(self) -> Led:
        deadline = time.monotonic() + self._errand.timeout_s
        while time.monotonic() < deadline and self._led.problem is not None and self._errand.wanted():
            try:
                self._look()
            except DeviceTimeout:
                self._led = Led(None, "it does not answer")
            except Unavailable as error:
                return Led(None, str(error))
            except DriverError as error:
                self._led = replace(self._led, problem=str(error))
            self._axis.sdo.pause(LOOK_S)
        return self._led

    def _look(self) -> None:
        self._led = _read(self._axis)
        state = self._led.state
        if state is DriveState.SWITCH_ON_DISABLED:
            return
        words = _UNKNOWN if state is None else state.words
        self._led = replace(self._led, problem=f"it stays in {words}")
        if state is not None and self._may_step(state):
            for controlword in WAY_DOWN.get(state, ()):
                if self._errand.wanted():
                    self._axis.command(controlword)

    def _may_step(self, state: DriveState) -> bool:
        """Return whether to go on: an axis that brakes is not let go limp, no fault reset too soon."""
        if state is DriveState.QUICK_STOP_ACTIVE:
            return self._stands()
        if state is DriveState.FAULT:
            if time.monotonic() < self._fault_reset_s:
                return False
            self._fault_reset_s = time.monotonic() + FAULT_RESET_S
        return True

    def _stands(self) -> bool:
        before = self._axis.position()
        self._axis.sdo.pause(STANDS_S)
        return abs(self._axis.position() - before) <= STANDS_SHARE * self._errand.counts_per_turn


def _step_up(axis: Axis, errand: Errand, origin: DriveState) -> Led:
    controlword, target = WAY_UP[origin]
    led = _read(axis)
    if led.state in _WAY_UP_STATES[_WAY_UP_STATES.index(target) :]:
        return led
    mode = None
    if led.state is origin and target is DriveState.OPERATION_ENABLED:
        mode = hold_still(axis, errand.still_in)
        led = _read(axis)
    if led.state is not origin:
        return replace(led, problem=f"it is not in {origin.words}; reset it first")
    if not errand.wanted():
        return led
    axis.command(controlword)
    return replace(_await(axis, errand, origin, target), mode=mode)


def _await(axis: Axis, errand: Errand, origin: DriveState, target: DriveState) -> Led:
    deadline = time.monotonic() + errand.timeout_s
    led = _read(axis)
    while led.state is origin and time.monotonic() < deadline and errand.wanted():
        axis.sdo.pause(LOOK_S)
        led = _read(axis)
    if led.state is target:
        return led
    return replace(led, problem=f"it did not go from {origin.words} to {target.words}")
