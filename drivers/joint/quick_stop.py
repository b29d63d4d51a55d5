"""Stops one axis by SDO: asks for it, and answers only what the statusword confirms.

A stop is asked for without knowing the state, because in no state can its controlwords enable the drive or
reset a fault (`commands.py`). As long as the statusword does not say that the axis stops, it is asked again.
"""

import time
from collections.abc import Collection
from enum import StrEnum

from drivers.errors import DeviceAbort, DeviceTimeout, Unavailable
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState
from drivers.joint.commands import Controlword

CONFIRMING_READS = 2  # another master may enable the drive again between two of its cycles
READ_PERIOD_S = 0.01
# How long an answer is waited for before it is asked again: twice as long each time, up to the channel's.
FIRST_PATIENCE_S = 0.05


class StopOutcome(StrEnum):
    """What is known about a drive after a stop was asked of it."""

    CONFIRMED = "confirmed"  # its statusword says that it brakes, has stopped or is switched off
    UNCONFIRMED = "unconfirmed"  # it answers, but not that
    UNREACHABLE = "unreachable"  # it does not answer


class Stopping:
    """One stop of one axis: `ask`, then `confirm`; neither raises for what the device does.

    Both are jobs of their own, so that the axes that share a node are all asked before one is waited for.
    """

    def __init__(
        self, controlword: Controlword, confirmed_by: Collection[DriveState], timeout_s: float
    ) -> None:
        self._controlword = controlword
        self._confirmed_by = confirmed_by
        self._deadline = time.monotonic() + timeout_s
        self._patience_s = FIRST_PATIENCE_S
        self._answered = False
        self._reads = 0

    def ask(self, axis: Axis) -> None:
        """Send the controlword; a refusal is an answer too, and the statusword may say why it need not."""
        try:
            axis.command(self._controlword, self._take_patience(axis))
            self._answered = True
        except DeviceAbort:
            self._answered = True
        except (DeviceTimeout, Unavailable):
            return

    def confirm(self, axis: Axis) -> StopOutcome:
        """What the statusword says until the time is over."""
        while self._reads < CONFIRMING_READS and time.monotonic() < self._deadline:
            try:
                self._look(axis)
            except DeviceAbort:
                self._answered = True
            except DeviceTimeout:
                self._reads = 0
            except Unavailable:
                break
            if not self._reads:
                self.ask(axis)
            time.sleep(min(READ_PERIOD_S, max(0.0, self._deadline - time.monotonic())))
        if self._reads >= CONFIRMING_READS:
            return StopOutcome.CONFIRMED
        return StopOutcome.UNCONFIRMED if self._answered else StopOutcome.UNREACHABLE

    def _look(self, axis: Axis) -> None:
        state = axis.state(self._take_patience(axis))
        self._answered = True
        self._reads = self._reads + 1 if state in self._confirmed_by else 0

    def _take_patience(self, axis: Axis) -> float:
        patience_s = min(self._patience_s, axis.sdo.timeout_s)
        if not self._answered:
            self._patience_s *= 2
        return patience_s
