"""Stops one axis by SDO: asks for it, and answers only what the statusword confirms.

A stop is asked for without knowing the state, because in no state can its controlwords enable the drive or
reset a fault (`commands.py`). As long as the statusword does not say that the axis stops, it is asked again.
"""

import time
from collections.abc import Collection
from enum import StrEnum

from drivers.bus.sender import BusFull
from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import Controlword

CONFIRMING_READS = 2  # another master may enable the drive again between two of its cycles
READ_PERIOD_S = 0.01
PAUSE_S = 0.002  # how long one axis keeps the node's worker from another one while it only waits
# How long an answer is waited for before it is asked again: twice as long each time, up to the channel's.
FIRST_PATIENCE_S = 0.05


class StopOutcome(StrEnum):
    """Knowledge about a drive after a stop."""

    CONFIRMED = "confirmed"  # its statusword says that it brakes, has stopped or is switched off
    UNCONFIRMED = "unconfirmed"  # it answers, but not that
    UNREACHABLE = "unreachable"  # it does not answer


class Stopping:
    """One stop of one axis: `turn` again and again, until it says what is known.

    A turn is one request, in a job of its own, so that the axes that share a node's channel take turns. Its
    time begins with the first one. It never raises for what the device does.
    """

    def __init__(
        self, controlword: Controlword, confirmed_by: Collection[DriveState], timeout_s: float, *, asked: bool
    ) -> None:
        """`asked`: the controlword went another way already."""
        self.read_ns = 0  # when the first of the reads was begun that confirm it
        self.state: DriveState | None = None  # as the drive has said last
        self._controlword = controlword
        self._confirmed_by = confirmed_by
        self._timeout_s = timeout_s
        self._deadline: float | None = None
        self._ask_next = not asked
        self._look_due = 0.0
        self._patience_s = FIRST_PATIENCE_S
        self._answered = False
        self._reads = 0

    def turn(self, axis: Axis) -> StopOutcome | None:
        """Send the controlword, or look at the statusword; `None`: it wants another turn."""
        now = time.monotonic()
        if self._deadline is None:
            self._deadline = now + self._timeout_s
        if now >= self._deadline:
            return self._unconfirmed()
        if self._ask_next:
            self._ask_next = False
            self._ask(axis)
        elif now < self._look_due:
            time.sleep(min(self._look_due - now, PAUSE_S))
        elif not self._look(axis):
            return self._unconfirmed()
        return StopOutcome.CONFIRMED if self._reads >= CONFIRMING_READS else None

    def _unconfirmed(self) -> StopOutcome:
        return StopOutcome.UNCONFIRMED if self._answered else StopOutcome.UNREACHABLE

    def _ask(self, axis: Axis) -> None:
        """Send it; a refusal is an answer too, and the statusword may say why it need not."""
        try:
            axis.command(self._controlword, self._take_patience(axis))
            self._answered = True
        except DeviceAbort:
            self._answered = True
        except (DeviceTimeout, Unavailable):
            return

    def _look(self, axis: Axis) -> bool:
        """Return whether the bus is open. Any answer but that the axis stops is asked for again."""
        began_ns = time.monotonic_ns()
        try:
            state = self.state = axis.state(self._take_patience(axis))
            self._answered = True
            self._reads = self._reads + 1 if state in self._confirmed_by else 0
        except DeviceAbort:
            self._answered = True
        except (DeviceTimeout, BusFull):
            self._reads = 0
        except Unavailable:
            return False
        if self._reads == 1:
            self.read_ns = began_ns
        self._ask_next = self._reads == 0
        self._look_due = time.monotonic() + READ_PERIOD_S
        return True

    def _take_patience(self, axis: Axis) -> float:
        patience_s = min(self._patience_s, axis.sdo.timeout_s)
        if not self._answered:
            self._patience_s *= 2
        return patience_s
