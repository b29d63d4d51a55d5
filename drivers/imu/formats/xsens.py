"""Format `xsens`: Xsens MTi devices, Xbus messages with MTData2 inside (115200 baud by default).

FAh FFh · message · length (FFh: u16 follows) · payload · sum: all bytes after FAh add up to 0 modulo 256. An
MTData2 payload is a list of items: id (u16) · length (u8) · data, all big-endian; the id's last four bits are
the number format and the frame of reference. (Xsens, "MT Low Level Communication Protocol".)
"""

import math
import struct
from collections.abc import Callable

from drivers.clock import ClockSpec
from drivers.imu.format import Format
from drivers.imu.frame import ImuFrame, More
from drivers.parsing import IMPOSSIBLE, FrameScanner, Sequence, needs

MTDATA2 = 0x36
MESSAGES = {
    0x3E: "wake_up",
    0x42: "error",
    0x31: "configuration_acknowledged",
    0x11: "measurement_acknowledged",
}
LONGEST_PAYLOAD = 2048
EXTENDED = 0xFF
CLOCK = ClockSpec(10_000, 1 << 32)  # sample time fine

FORMAT_BITS, FRAME_BITS = 0x0003, 0x000C
NORTH_EAST_DOWN = 0x0004
CLIPPED = 0x1FF00 | 1 << 19  # status word: an accelerometer, gyroscope or magnetometer axis at its end

TEMPERATURE, COUNTER, TIME_FINE, TIME_COARSE = 0x0810, 0x1020, 0x1060, 0x1070
QUATERNION, EULER, PRESSURE = 0x2010, 0x2030, 0x3010
DELTA_V, ACCELERATION, FREE_ACCELERATION, ACCELERATION_HR = 0x4010, 0x4020, 0x4030, 0x4040
RATE, DELTA_Q, RATE_HR, MAGNETIC, STATUS_BYTE, STATUS = 0x8020, 0x8030, 0x8040, 0xC020, 0xE010, 0xE020

INTEGERS = {COUNTER: 2, TIME_FINE: 4, TIME_COARSE: 4, PRESSURE: 4, STATUS_BYTE: 1, STATUS: 4}
REALS = {
    TEMPERATURE: 1,
    QUATERNION: 4,
    EULER: 3,
    DELTA_V: 3,
    ACCELERATION: 3,
    FREE_ACCELERATION: 3,
    ACCELERATION_HR: 3,
    RATE: 3,
    DELTA_Q: 4,
    RATE_HR: 3,
    MAGNETIC: 3,
}
MORE = {
    TIME_COARSE: ("time_coarse",),
    PRESSURE: ("pressure",),
    STATUS: ("status",),
    STATUS_BYTE: ("status",),
    DELTA_V: ("delta_velocity_x", "delta_velocity_y", "delta_velocity_z"),
    DELTA_Q: ("delta_orientation_w", "delta_orientation_x", "delta_orientation_y", "delta_orientation_z"),
    FREE_ACCELERATION: ("free_acceleration_x", "free_acceleration_y", "free_acceleration_z"),
    MAGNETIC: ("magnetic_relative_x", "magnetic_relative_y", "magnetic_relative_z"),
}

Numbers = tuple[float, ...]


def _fixed_12_20(data: bytes) -> Numbers:
    return tuple(raw / (1 << 20) for raw in struct.unpack(f">{len(data) // 4}i", data))


def _fixed_16_32(data: bytes) -> Numbers:
    """Decode numbers with four bytes of fraction, then two of whole part."""
    return tuple(whole + part / (1 << 32) for part, whole in struct.iter_unpack(">Ih", data))


def _single(data: bytes) -> Numbers:
    return struct.unpack(f">{len(data) // 4}f", data)


def _double(data: bytes) -> Numbers:
    return struct.unpack(f">{len(data) // 8}d", data)


# the id's lowest two bits → size of a number, how to read them
NUMBER_FORMATS: tuple[tuple[int, Callable[[bytes], Numbers]], ...] = (
    (4, _single),
    (4, _fixed_12_20),
    (6, _fixed_16_32),
    (8, _double),
)


class XsensParser(FrameScanner[ImuFrame]):
    """Parser of `xsens`; messages that are no measurement come as frames of their own kind."""

    sync = b"\xfa\xff"

    def __init__(self) -> None:
        super().__init__()
        self._sequence = Sequence(self.counters, 1 << 16)

    def _restart(self) -> None:
        self._sequence.restart()

    def _length(self, buffer: bytearray, start: int) -> int:
        if len(buffer) < start + 4:
            return needs(4)
        if buffer[start + 3] != EXTENDED:
            return 5 + buffer[start + 3]
        if len(buffer) < start + 6:
            return needs(6)
        payload = int.from_bytes(buffer[start + 4 : start + 6], "big")
        return 7 + payload if payload <= LONGEST_PAYLOAD else IMPOSSIBLE

    def _decode(self, raw: bytes) -> ImuFrame | None:
        if sum(raw[1:]) & 0xFF:
            self.counters.bad_checksums += 1
            return None
        message, payload = raw[2], raw[6 if raw[3] == EXTENDED else 4 : -1]
        if message != MTDATA2:
            return ImuFrame(MESSAGES.get(message, f"message_{message:02x}"), more={"data": payload.hex()})
        items = _items(payload)
        if items is None:
            self.counters.malformed += 1
            return None
        return self._measurement(items)

    def _measurement(self, items: dict[int, bytes]) -> ImuFrame:
        values: dict[int, Numbers] = {}
        more: More = {}
        z_down = False
        for item, data in items.items():
            kind = item & ~(FORMAT_BITS | FRAME_BITS)
            numbers = _numbers(kind, item, data)
            if numbers is None:
                more[f"item_{item:04x}"] = data.hex()
                continue
            values[kind] = numbers
            more |= zip(MORE.get(kind, ()), numbers, strict=False)
            if kind in (QUATERNION, EULER):
                z_down = item & FRAME_BITS == NORTH_EAST_DOWN
        return self._frame(values, z_down, more)

    def _frame(self, values: dict[int, Numbers], z_down: bool, more: More) -> ImuFrame:
        counter, ticks = values.get(COUNTER), values.get(TIME_FINE)
        euler, quaternion = values.get(EULER), values.get(QUATERNION)
        acceleration = values.get(ACCELERATION, values.get(ACCELERATION_HR))
        rate, temperature = values.get(RATE, values.get(RATE_HR)), values.get(TEMPERATURE)
        self.counters.saturated += bool(int(values.get(STATUS, (0,))[0]) & CLIPPED)
        return ImuFrame(
            "mtdata2",
            acceleration=None
            if acceleration is None
            else (acceleration[0], acceleration[1], acceleration[2]),
            angular_velocity=None if rate is None else (rate[0], rate[1], rate[2]),
            roll_pitch_yaw=None
            if euler is None
            else (math.radians(euler[0]), math.radians(euler[1]), math.radians(euler[2])),
            orientation=None
            if quaternion is None
            else (quaternion[0], quaternion[1], quaternion[2], quaternion[3]),
            z_down=z_down,
            temperature=None if temperature is None else temperature[0],
            sequence=None if counter is None else int(counter[0]),
            ticks=None if ticks is None else int(ticks[0]),
            late=counter is not None and self._sequence.is_late(int(counter[0])),
            more=more,
        )


def _items(payload: bytes) -> dict[int, bytes] | None:
    """Return the payload's items by id; `None` where they do not fill it exactly."""
    items: dict[int, bytes] = {}
    at = 0
    while at + 3 <= len(payload):
        end = at + 3 + payload[at + 2]
        items[int.from_bytes(payload[at : at + 2], "big")] = payload[at + 3 : end]
        at = end
    return items if at == len(payload) else None


def _numbers(kind: int, item: int, data: bytes) -> Numbers | None:
    """Return the item's numbers; `None` for an item that is not known or has another size."""
    if INTEGERS.get(kind) == len(data):
        return (int.from_bytes(data, "big"),)
    size, read = NUMBER_FORMATS[item & FORMAT_BITS]
    if kind in REALS and len(data) == REALS[kind] * size:
        return read(data)
    return None


FORMAT = Format(XsensParser, CLOCK)
