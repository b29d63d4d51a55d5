"""Homing by the drive itself (CiA 402-2 §11, mode 6): what it offers, how it is set up, begun and followed.

Nothing here enables: `begin` moves an axis only where it is enabled in this mode already.
"""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from enum import Enum

from drivers.bus.values import unsigned
from drivers.errors import DeviceAbort, Mismatch
from drivers.joint.axis import Axis
from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.commands import STATUSWORD, Controlword
from drivers.joint.transitions import OVERTAKEN, Errand, Led
from eds import Description

HOMING = 6  # of 6060h
MODE, MODE_DISPLAY, MODES = 0x6060, 0x6061, 0x6502
HOME_OFFSET, METHOD, SPEEDS, ACCELERATION, OFFERED = 0x607C, 0x6098, 0x6099, 0x609A, 0x60E3
FOLLOWING_ERROR = 0x60F4
SWITCH, ZERO = 1, 2  # sub-indices of 6099h: speed to the switch, speed to the zero

Number = Callable[[int, int], int | None]  # an unsigned object of the axis; None where it has none

_LOW, _HIGH, _HOME = "the negative limit switch", "the positive limit switch", "the home switch"
_INDEX = "the encoder's index"


@dataclass(frozen=True, slots=True)
class Method:
    """A homing method in words, and whether it moves."""

    words: str
    moves: bool = True


def _methods() -> Iterator[tuple[int, Method]]:
    """CiA 402-2 §11, table of homing methods; from 15 to 32 what is not here is reserved."""
    yield 1, Method(f"moves to {_LOW}, then to {_INDEX}")
    yield 2, Method(f"moves to {_HIGH}, then to {_INDEX}")
    for number in range(3, 15):
        yield number, Method(f"moves to {_HOME}, then to {_INDEX}")
    yield 17, Method(f"moves to {_LOW}")
    yield 18, Method(f"moves to {_HIGH}")
    for number in range(19, 31):
        yield number, Method(f"moves to {_HOME}")
    yield 33, Method(f"moves in the negative direction to {_INDEX}")
    yield 34, Method(f"moves in the positive direction to {_INDEX}")
    for number in (37, 35):
        yield number, Method("takes the present position as home and moves nothing", moves=False)


METHODS: Mapping[int, Method] = dict(_methods())
ORDER = sorted(METHODS, key=lambda number: METHODS[number].moves)  # what moves nothing comes first


class HomingProgress(Enum):
    """Statusword bits 13 (homing error), 12 (homing attained) and 10 (target reached), CiA 402-2 §11."""

    UNDER_WAY = 0b000
    NOT_STARTED = 0b001  # or interrupted
    ATTAINED = 0b010  # home is known, the axis comes to rest
    COMPLETE = 0b011
    FAILED_MOVING = 0b100
    FAILED = 0b101
    RESERVED = 0b110

    @property
    def words(self) -> str:
        return self.name.lower().replace("_", " ")

    @property
    def failed(self) -> bool:
        return self in (HomingProgress.FAILED, HomingProgress.FAILED_MOVING, HomingProgress.RESERVED)


def progress(statusword: int) -> HomingProgress:
    """Return the progress of homing by a statusword; valid only while the axis is enabled in that mode."""
    error, attained, reached = (statusword >> bit & 1 for bit in (13, 12, 10))
    return (
        HomingProgress.RESERVED
        if error and attained
        else HomingProgress(error << 2 | attained << 1 | reached)
    )


@dataclass(frozen=True, slots=True)
class Setup:
    """Settings before homing: the method, and speeds and acceleration in the drive's own units."""

    method: int
    switch_speed: int | None = None  # None: is left as it is
    zero_speed: int | None = None
    acceleration: int | None = None

    def writes(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield index, sub-index and data, in their order."""
        yield METHOD, 0, self.method.to_bytes(1, "little", signed=True)
        for index, subindex, value in (
            (SPEEDS, SWITCH, self.switch_speed),
            (SPEEDS, ZERO, self.zero_speed),
            (ACCELERATION, 0, self.acceleration),
        ):
            if value is not None:
                yield index, subindex, value.to_bytes(4, "little")


@dataclass(frozen=True, slots=True)
class AxisReading:
    """One reading of an axis."""

    state: DriveState | None
    progress: HomingProgress
    position: int  # counts
    lag: int | None  # counts, 60F4h; None: the drive does not tell


def offered(number: Number, description: Description, offset: int) -> tuple[int, ...]:
    """Return the drive's methods of METHODS: by 60E3h, else by its file's limits of 6098h.

    Those that move nothing come first. None where the drive says that it has no such mode (6502h). Raises
    what `number` does.
    """
    modes = number(MODES, 0)
    if not description.has(METHOD + offset) or (modes is not None and not modes >> HOMING - 1 & 1):
        return ()
    listed = _listed(number)
    if listed is None:
        variable = description.variable(METHOD + offset)
        low = -128 if variable is None or variable.min is None else variable.min
        high = 127 if variable is None or variable.max is None else variable.max
        listed = frozenset(number for number in METHODS if low <= number <= high)
    return tuple(number for number in ORDER if number in listed)


def _listed(number: Number) -> frozenset[int] | None:
    """60E3h; `None` where the drive has none, or an empty one."""
    count = (number(OFFERED, 0) or 0) & 0xFF
    found = [number(OFFERED, subindex) for subindex in range(1, count + 1)]
    return frozenset(_signed(one) for one in found if one) or None


def _signed(number: int) -> int:
    """Return the number of an INTEGER8: some devices answer with four bytes."""
    return (number & 0xFF ^ 0x80) - 0x80


def set_up(axis: Axis, setup: Setup) -> None:
    """Write it all and read it back, then the mode; raises `DriverError` where the drive does not hold it.

    It moves nothing: a homing begins with a bit of the controlword, for which 6061h must show the mode.
    """
    for index, subindex, data in setup.writes():
        axis.write(index, data, subindex)
        held = axis.read(index, len(data), subindex)
        if held != data:
            raise Mismatch(
                f"{axis.sdo.label}: {index + axis.offset:04X}h:{subindex} is {held.hex(' ')} after "
                f"{data.hex(' ')} was written"
            )
    axis.write(MODE, bytes([HOMING]))


def mode_of(axis: Axis) -> bytes:
    """Return the mode of operation that was asked of it (6060h).

    6061h may show another while it has no power.
    """
    try:
        return axis.read(MODE, 1)
    except DeviceAbort:
        return axis.read(MODE_DISPLAY, 1)


def leave(axis: Axis, mode: bytes) -> None:
    """Give it its mode of operation back; raises `DriverError` where it does not hold it."""
    axis.write(MODE, mode)
    with suppress(DeviceAbort):
        if (held := axis.read(MODE, 1)) != mode:
            raise Mismatch(f"{axis.sdo.label}: {MODE + axis.offset:04X}h is {held.hex()}, not {mode.hex()}")


def look(axis: Axis) -> AxisReading:
    """Read position and progress. A position beside UNDER_WAY counts from the old zero: it was read first."""
    position, lag = axis.position(), None
    with suppress(DeviceAbort):
        lag = int.from_bytes(axis.read(FOLLOWING_ERROR, 4), "little", signed=True)
    word = unsigned(axis.read(STATUSWORD, 2))
    return AxisReading(drive_state(word), progress(word), position, lag)


def begin(axis: Axis, errand: Errand) -> Led:
    """Let bit 4 of the controlword rise, where the axis is enabled in this mode and does not home yet."""
    word = unsigned(axis.read(STATUSWORD, 2))
    state, mode = drive_state(word), axis.read(MODE_DISPLAY, 1)[0]
    if not errand.wanted():
        return Led(state, OVERTAKEN)
    if state is not DriveState.OPERATION_ENABLED:
        return Led(state, "it is not enabled")
    if mode != HOMING:
        return Led(state, f"its mode of operation is {mode} (6061h), not homing", mode)
    if progress(word) is HomingProgress.UNDER_WAY:
        return Led(state, "it says that it is homing already", mode)
    axis.command(Controlword.START_HOMING)
    return Led(state, None, mode)
