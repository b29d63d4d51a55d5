"""A BNO08x in UART-RVC mode (CEVA data sheet): 19 bytes, `AA AA index yaw pitch roll ax ay az … sum`.

Angles in 0.01°, acceleration in 0.001 g. As on a phone, roll turns about y and pitch about x.
"""

import math
import struct

from hil_sim.gait.wearer import GRAVITY
from hil_sim.sensors.serial_sensor import SerialFormat, Tick
from hil_sim.sensors.trunk_imu import AXES, Motion, Quaternion, Vector


def phone_angles(q: Quaternion) -> Vector:
    """Yaw about z, then pitch about x, then roll about y (rad), of an orientation."""
    w, x, y, z = q
    yaw = math.atan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z))
    pitch = math.asin(min(max(2 * (y * z + w * x), -1.0), 1.0))
    roll = math.atan2(2 * (w * y - x * z), 1 - 2 * (x * x + y * y))
    return yaw, pitch, roll


def encode(motion: Motion, tick: Tick) -> bytes:
    angles = [round(math.degrees(angle) * 100) for angle in phone_angles(motion.orientation)]
    forces = [round(part / GRAVITY * 1000) for part in motion.acceleration]
    body = struct.pack("<B6h3x", tick.number & 0xFF, *angles, *forces)
    return b"\xaa\xaa" + body + bytes([sum(body) & 0xFF])


BNO08X_RVC = SerialFormat(
    encode, baudrate=115200, keys=AXES, banner=b"%Hillcrest Labs 10003608\r\n%SW Ver 3.12.4\r\n%(c) 2018\r\n"
)

IMUS = {"bno08x-rvc": BNO08X_RVC}
