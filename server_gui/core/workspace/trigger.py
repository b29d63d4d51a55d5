"""A trigger as an oscilloscope has one: what is waited for, and what is shown once it has come."""

import math
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
AUTO_S: Final = 2.0  # without a trigger, a view that is `auto` goes on by itself
LONGEST_HOLD_S: Final = 60.0


class On(Enum):
    """Condition of a trigger."""

    RISE = "rises through"
    FALL = "falls through"
    ABOVE = "is at or above"
    BELOW = "is below"
    ENTERS = "comes into"
    LEAVES = "goes out of"
    EMCY = "emergency (EMCY)"


WINDOWS: Final = (On.ENTERS, On.LEAVES)
EDGES: Final = (On.RISE, On.FALL, On.ENTERS, On.LEAVES)


class Mode(Enum):
    """Mode after a trigger."""

    AUTO = "auto"  # shows what comes where nothing triggers
    NORMAL = "normal"  # keeps the last until the next
    SINGLE = "single"  # keeps the first


class TriggerState(Enum):
    """State of a trigger."""

    OFF = "off"
    ARMED = "armed"
    TRIGGERED = "triggered"  # what comes after it is waited for
    SHOWN = "shown"  # all of it stands; armed again after the hold-off
    STOPPED = "stopped"  # a single one has been


@dataclass(frozen=True, slots=True)
class Condition:
    """`of` is a curve as it is written, or a component for `On.EMCY`; `level` and `high` are SI.

    `before` is the share of what is seen that is before the trigger, 0 to 1. For `hold_off_s` after
    one nothing triggers.
    """

    on: On = On.RISE
    of: str = ""
    level: float = 0.0
    high: float = 0.0
    mode: Mode = Mode.NORMAL
    before: float = 0.5
    hold_off_s: float = 0.0

    @property
    def problem(self) -> str:
        """Why it can never trigger; empty where it can."""
        if not self.of:
            return "the trigger has no curve"
        if not all(map(math.isfinite, (self.level, self.high, self.before, self.hold_off_s))):
            return "the trigger has a number that is none"
        if self.on in WINDOWS and not self.level < self.high:
            return "the window's upper end is to be above its lower one"
        if not 0.0 <= self.before <= 1.0:
            return "the share before the trigger is 0 to 1"
        if not 0.0 <= self.hold_off_s <= LONGEST_HOLD_S:
            return f"the hold-off is 0 to {LONGEST_HOLD_S:g} s"
        return ""


class Trigger:
    """`take` brings rows as they come; `at_s` is when it has triggered, on their axis."""

    def __init__(self) -> None:
        self.condition = Condition()
        self.state = TriggerState.OFF
        self.at_s: float | None = None
        self.count = 0
        self._since_s: float | None = None  # rows before are no news
        self._armed_s: float | None = None

    def arm(self, condition: Condition, newest_s: float | None) -> None:
        """Wait for this, in what comes after `newest_s`."""
        self.condition, self.count = condition, 0
        self._wait(newest_s)

    def _wait(self, since_s: float | None) -> None:
        self.state, self.at_s = TriggerState.ARMED, None
        self._since_s, self._armed_s = since_s, since_s

    def off(self) -> None:
        """Wait for nothing."""
        self.state, self.at_s = TriggerState.OFF, None

    def begin_anew(self) -> None:
        """Reset for rows with another time axis."""
        if self.state is not TriggerState.OFF and self.state is not TriggerState.STOPPED:
            self._wait(None)

    def shows_live(self, newest_s: float) -> bool:
        """Return whether to show what comes, for want of anything better."""
        if self.state is TriggerState.OFF:
            return True
        if self.state is not TriggerState.ARMED:
            return False
        waited = math.inf if self._armed_s is None else newest_s - self._armed_s
        return not self.count or (self.condition.mode is Mode.AUTO and waited > AUTO_S)

    def take(self, times: Floats, values: Floats, span_s: float) -> bool:
        """Look at rows, old ones among them; whether what was waited for is whole now and is to be shown."""
        if not len(times):
            return False
        newest_s = float(times[-1])
        if (
            self.state is TriggerState.SHOWN
            and self.at_s is not None
            and self.condition.mode is not Mode.SINGLE
        ):
            due_s = max(self.at_s + self.condition.hold_off_s, self._since_s or -math.inf)
            if newest_s >= due_s:
                self.state, self._since_s, self._armed_s = TriggerState.ARMED, due_s, due_s
        if self.state is TriggerState.ARMED:
            self._look(times, values)
        if self.state is not TriggerState.TRIGGERED or self.at_s is None:
            return False
        if newest_s < self.at_s + (1.0 - self.condition.before) * span_s:
            return False
        self.state = TriggerState.STOPPED if self.condition.mode is Mode.SINGLE else TriggerState.SHOWN
        self._since_s = newest_s
        return True

    def _look(self, times: Floats, values: Floats) -> None:
        first = 0 if self._since_s is None else int(np.searchsorted(times, self._since_s, "right"))
        new = values[first:]
        if not len(new):
            return
        # What was there when the wait began is news of nothing, but an edge may come from it.
        before = np.concatenate((values[first - 1 : first] if first else [math.nan], new[:-1]))
        place = first_place(self.condition, before, new)
        if place is None:
            self._since_s = float(times[-1])
            return
        self.state, self.at_s, self.count = (
            TriggerState.TRIGGERED,
            float(times[first + place]),
            self.count + 1,
        )

    def text(self, newest_s: float | None) -> str:
        """Return its state, in words; times are s until the newest row."""
        if self.at_s is None or newest_s is None:
            return (
                f"{self.state.value}: waits for {self.condition.of}"
                if self.state is TriggerState.ARMED
                else self.state.value
            )
        ago = f"{max(newest_s - self.at_s, 0.0):.1f} s ago"
        match self.state:
            case TriggerState.STOPPED:
                return f"stopped: triggered {ago}"
            case TriggerState.ARMED:
                return f"armed: number {self.count} was {ago}"
            case TriggerState.TRIGGERED:
                return f"triggered {ago}, waits for what comes after"
        return f"number {self.count} triggered {ago}"


def first_place(condition: Condition, before: Floats, values: Floats) -> int | None:
    """Return the first row at which it triggers; `before` has the value of the row before each.

    What is missing is no level, and no edge comes from or leads to it.
    """
    low, high = condition.level, condition.high
    with np.errstate(invalid="ignore"):
        known = ~np.isnan(values)
        if condition.on in EDGES:
            known &= ~np.isnan(before)
        inside, was_inside = ((low <= column) & (column <= high) for column in (values, before))
        met = {
            On.RISE: (before < low) & (values >= low),
            On.FALL: (before > low) & (values <= low),
            On.ABOVE: values >= low,
            On.BELOW: values < low,
            On.ENTERS: inside & ~was_inside,
            On.LEAVES: ~inside & was_inside,
            On.EMCY: (values != 0.0) & (values != before) & ~np.isnan(before),
        }[condition.on]
    found = np.flatnonzero(met & known)
    return int(found[0]) if len(found) else None
