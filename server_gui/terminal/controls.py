"""Keys of the dashboard: choose a parameter, raise or lower it, stop, end a held stop, quit. No drawing."""

import math
import sys
import time
from collections.abc import Callable

from gateway.units import Units
from gateway.wire.control import CONTROL_ACQUIRE
from gateway.wire.parameter import PARAMETER_WRITE, ParameterInfo
from gateway.wire.stop import ROBOT_RESET
from server_gui.core.desk.station import Station
from server_gui.core.tuning.edits import ReviewedEdit, refusal, unit_of
from server_gui.core.tuning.stop import StopState
from server_gui.core.tuning.writing import WriteState
from server_gui.terminal.keys import Key

STEPS = 20  # from one end of a parameter's range to the other
AGAIN_S = 3.0  # within which a reset is asked for twice
SAID_S = 5.0  # for so long a refused key is told: what matters more comes back
ENDS = "r again ends the held stop and clears faults: every drive is switched off, none is enabled"
TAKES = "r again takes power from every drive, and a wearer's support (no held stop known)"


class Controls:
    """The selected parameter and what is under way. Belongs to the thread that draws."""

    def __init__(self, station: Station) -> None:
        self.wants_to_quit = False
        self.stop_sent = False
        self.note = ""
        self._refusal, self._refused_until_s = "", 0.0
        self._reset_until_s = 0.0  # a second press until then is one
        self._station = station
        self._row = 0
        self._does: dict[Key, Callable[[], None]] = {
            Key.UP: lambda: self._move(-1),
            Key.DOWN: lambda: self._move(+1),
            Key.LEFT: lambda: self._change(-1),
            Key.RIGHT: lambda: self._change(+1),
            Key.STOP: self._stop,
            Key.RESET: self._reset,
            Key.QUIT: self._quit,
        }

    @property
    def names(self) -> list[str]:
        """The parameters that can be chosen, in the robot's order."""
        return [name for name in self._station.robot.parameters if name in self._station.known]

    @property
    def selected(self) -> str | None:
        """The chosen parameter, None while none is known."""
        names = self.names
        return names[min(self._row, len(names) - 1)] if names else None

    @property
    def no_change(self) -> str:
        """Why we may not change parameters; empty where we may, as far as is known."""
        return self._station.refused(CONTROL_ACQUIRE) or self._station.refused(PARAMETER_WRITE)

    @property
    def no_reset(self) -> str:
        """Why we may not end a held stop."""
        return self._station.refused(ROBOT_RESET)

    @property
    def refusal(self) -> str:
        """Why the last key has done nothing, for some seconds."""
        return self._refusal if time.monotonic() < self._refused_until_s else ""

    @property
    def asks_again(self) -> bool:
        """Whether a second press of the same key is waited for."""
        return time.monotonic() < self._reset_until_s

    @property
    def is_over(self) -> bool:
        """Whether to end now: what a STOP comes to is waited for."""
        return self.wants_to_quit and not self._stop_is_open

    @property
    def writing(self) -> bool:
        """Whether a write is under way."""
        return self._station.writing.state is WriteState.WRITING

    def press(self, key: Key) -> None:
        """Carry out a key; a STOP is shown until a key is pressed after its answer, or failure."""
        self.stop_sent = key is Key.STOP or (self.stop_sent and self._stop_is_open)
        self._refusal, self._refused_until_s = self._refused(key), time.monotonic() + SAID_S
        if not self._refusal:
            self._does[key]()

    def _refused(self, key: Key) -> str:
        """Return why a key's action is not allowed; navigation, quitting and STOP always are."""
        if key in (Key.LEFT, Key.RIGHT):
            return self.no_change
        return self.no_reset if key is Key.RESET else ""

    @property
    def _stop_is_open(self) -> bool:
        return self._station.stopping.state is StopState.SENT

    def _move(self, by: int) -> None:
        self._row = max(0, min(self._row + by, len(self.names) - 1))

    def _change(self, by: int) -> None:
        name = self.selected
        if name is None or self.writing:
            return
        value = self._station.robot.parameters[name].value
        info = self._station.known.get(name)
        if value is None or info is None:
            self.note = f"{name} is not known now, so it is not changed"
            return
        target = neighbour(value, by, info)
        if target is None:
            self.note = f"{name} has no limits to move between; use gwrms set {name}=VALUE"
        elif target != value:
            unit = unit_of(name, info.unit, Units())
            self.note = f"writing {name} = {unit.editable(target)} {unit.symbol}"
            problem = refusal(target, value, info, unit)
            self._station.write((ReviewedEdit(name, unit, value, target, elsewhere=False, problem=problem),))

    def _stop(self) -> None:
        self._station.stop("STOP key of the dashboard")

    def _reset(self) -> None:
        """End a held stop; a key that is hit by mistake does nothing."""
        if not self.asks_again:
            self._reset_until_s = time.monotonic() + AGAIN_S
            self.note = ENDS if self._station.stopping.held else TAKES
            return
        self._reset_until_s = 0.0
        self.note = "resetting …"
        self._station.reset()

    def _quit(self) -> None:
        self.wants_to_quit = True


def step_of(low: float, high: float, largest: float | None) -> float:
    """Return a round step (1, 2 or 5 times a power of ten), about 1/20 of the range and within `largest`."""
    wanted = high / STEPS - low / STEPS
    wanted = max(min(wanted, largest) if largest else wanted, sys.float_info.min)
    power = 10.0 ** math.floor(math.log10(wanted) + 1e-9)
    return max(factor * power for factor in (1.0, 2.0, 5.0) if factor * power <= wanted * (1 + 1e-9))


def neighbour(value: float, by: int, info: ParameterInfo) -> float | None:
    """Return the next step above (+1) or below (−1) a value, within its limits; None where there are none."""
    if info.min is None or info.max is None or info.max <= info.min:
        return None
    step = step_of(info.min, info.max, info.max_step)
    places = value / step
    if not math.isfinite(places):
        return None
    on_grid = round(places)
    if abs(places - on_grid) > 1e-6:
        on_grid = math.floor(places) + (by < 0)
    # Ten digits: 0.42, not 0.42000000000000004.
    target = float(f"{(on_grid + by) * step:.10g}")
    if info.max_step:  # a value that is all but on the grid would go a little further than it may
        target = min(max(target, value - info.max_step), value + info.max_step)
    return min(max(target, info.min), info.max)
