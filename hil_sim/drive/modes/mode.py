"""The common parts of all modes of operation: set-points in, motion of the servo out, statusword bits."""

from enum import IntEnum

from hil_sim.drive import objects as od
from hil_sim.drive.objects import Objects
from hil_sim.drive.options import ramp
from hil_sim.drive.servo import Servo
from hil_sim.drive.settings import Window
from hil_sim.node.dictionary import Key


class ModeNumber(IntEnum):
    """Modes of operation that the simulated drive has (6060h; bit n − 1 of 6502h)."""

    PROFILE_POSITION = 1
    PROFILE_VELOCITY = 3
    PROFILE_TORQUE = 4
    HOMING = 6
    CYCLIC_SYNCHRONOUS_POSITION = 8
    CYCLIC_SYNCHRONOUS_VELOCITY = 9
    CYCLIC_SYNCHRONOUS_TORQUE = 10


# Bits of the statusword that mean something else in each mode.
TARGET_REACHED = 1 << 10
BIT_12 = 1 << 12
BIT_13 = 1 << 13

HALT = 1 << 8  # of the controlword


class Mode:
    """One mode; it is told what happens only while the drive is in OPERATION ENABLED.

    `clipped` says that a set-point is beyond a limit and was taken no further than that.
    """

    follows_position = False  # the following error is watched

    def __init__(self, servo: Servo, objects: Objects) -> None:
        self.servo = servo
        self.objects = objects
        self.clipped = False
        self.halted = False

    def enter(self) -> None:
        """Begin this mode: the joint comes to rest and is held."""
        self.clipped = self.halted = False

    def command(self, controlword: int, risen: int) -> None:  # noqa: ARG002 - modes with a handshake add it
        """Take a controlword; `risen` are the bits that were 0 before."""
        halted = bool(controlword & HALT)
        if halted != self.halted:
            self.halted = halted
            if halted:
                self.halt()
            else:
                self.resume()

    def halt(self) -> None:
        """Bit 8 has risen: slow down as 605Dh says and stay enabled."""
        self.servo.stop(ramp(self.objects, od.HALT_OPTION))

    def resume(self) -> None:
        """Bit 8 has fallen."""

    def target_written(self, key: Key, changed: bool) -> None:
        """Take a write of a target object, with another value or the same."""

    def synchronise(self) -> None:
        """Take a SYNC; received PDOs have taken effect."""

    def update(self, elapsed_s: float) -> None:
        """Advance by `elapsed_s`."""

    def status(self) -> int:
        """Bits 10, 12 and 13 of the statusword (13 of position modes comes from the drive)."""
        return 0


class Dwell:
    """Timer for an error that stays within a window for the window's time."""

    def __init__(self) -> None:
        self._inside_s = 0.0
        self.reached = False

    def restart(self) -> None:
        self._inside_s, self.reached = 0.0, False

    def update(self, error: float, window: Window, elapsed_s: float) -> None:
        self._inside_s = self._inside_s + elapsed_s if abs(error) <= window.size else 0.0
        self.reached = self._inside_s > 0.0 and self._inside_s >= window.time_s
