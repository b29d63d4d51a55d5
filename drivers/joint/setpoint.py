"""Gives a drive the setpoint that moves nothing in the mode it is in (CiA 402-2: 607Ah, 60FFh, 6071h, …).

In the cyclic modes the drive adds offsets to it, or feeds them forward; they are zeroed where it has them.
"""

from collections.abc import Collection, Mapping

from drivers.bus.sdo.aborts import NO_OBJECT
from drivers.errors import DeviceAbort, DriverError, Mismatch
from drivers.joint.axis import POSITION_ACTUAL, Axis
from drivers.joint.cia402 import MODES, option_text

MODE_DISPLAY = 0x6061
_WHERE_IT_IS, _ZERO = True, False

# Modes of operation with the object of their setpoint: index, subindex, bytes, and what moves nothing there.
SETPOINTS: Mapping[int, tuple[int, int, int, bool]] = {
    1: (0x607A, 0, 4, _WHERE_IT_IS),  # profile position: target position
    2: (0x6042, 0, 2, _ZERO),  # velocity: vl target velocity
    3: (0x60FF, 0, 4, _ZERO),  # profile velocity: target velocity
    4: (0x6071, 0, 2, _ZERO),  # profile torque: target torque
    7: (0x60C1, 1, 4, _WHERE_IT_IS),  # interpolated position: first set-point
    8: (0x607A, 0, 4, _WHERE_IT_IS),  # cyclic synchronous position
    9: (0x60FF, 0, 4, _ZERO),  # cyclic synchronous velocity
    10: (0x6071, 0, 2, _ZERO),  # cyclic synchronous torque
}


# What a cyclic mode adds: index and bytes of position, velocity and torque offset (CiA 402-2 §14 to §16).
_POSITION_OFFSET, _VELOCITY_OFFSET, _TORQUE_OFFSET = (0x60B0, 4), (0x60B1, 4), (0x60B2, 2)
OFFSETS: Mapping[int, tuple[tuple[int, int], ...]] = {
    8: (_POSITION_OFFSET, _VELOCITY_OFFSET, _TORQUE_OFFSET),
    9: (_VELOCITY_OFFSET, _TORQUE_OFFSET),
    10: (_TORQUE_OFFSET,),
}


def hold_still(axis: Axis, still_in: Collection[int] = ()) -> int:
    """Write it, read it back, and return the mode (6061h); in the modes `still_in` there is none to write.

    Raises `DriverError` where the mode has no setpoint that is known to move nothing, or the drive does not
    confirm it: it must not be enabled then.
    """
    mode = int.from_bytes(axis.read(MODE_DISPLAY, 1), "little", signed=True)
    if mode in still_in:
        return mode
    if mode not in SETPOINTS:
        raise DriverError(
            f"{axis.sdo.label}: nobody knows what it would do in its mode of operation "
            f"({option_text(MODES, mode)}, 6061h is {mode}); set another one in 6060h"
        )
    for index, size in OFFSETS.get(mode, ()):
        _zero(axis, index, size)
    index, subindex, size, where_it_is = SETPOINTS[mode]
    _hold(axis, index, subindex, axis.read(POSITION_ACTUAL, size) if where_it_is else bytes(size))
    return mode


def _zero(axis: Axis, index: int, size: int) -> None:
    """Zero an offset, unless the drive does not have it."""
    try:
        _hold(axis, index, 0, bytes(size))
    except DeviceAbort as error:
        if error.abort_code != NO_OBJECT:
            raise


def _hold(axis: Axis, index: int, subindex: int, value: bytes) -> None:
    axis.write(index, value, subindex)
    held = axis.read(index, len(value), subindex)
    if held != value:
        raise Mismatch(
            f"{axis.sdo.label}: 0x{index + axis.offset:04X}:{subindex:02X} holds {held.hex(' ')} after "
            f"{value.hex(' ')} was written, so its setpoint would move it"
        )
