"""Child of the sensor benchmark: two insoles and a WitMotion IMU at 200 Hz on three open terminals."""

import os
import sys
import time

from tests.unit.imu.encode import witmotion
from tests.unit.insole.encode import RIGHT, cobs_frame

RATE_HZ = 200


def frames(number: int) -> tuple[bytes, bytes, bytes]:
    """What left insole, right insole and IMU send as their cycle `number`; an insole says when (µs)."""
    insoles = []
    for flags in (0, RIGHT):
        sent_us = time.monotonic_ns() // 1000 & 0xFFFFFFFF
        cells = [sent_us & 0xFFFF, sent_us >> 16, *(100 + (number + cell) % 50 for cell in range(14))]
        insoles.append(cobs_frame(cells, flags=flags, sequence=number, time_us=number * 5000))
    left, right = insoles
    imu = (
        witmotion(0x51, number % 50, -30, 2048, 2500)
        + witmotion(0x52, 5, -5, number % 9, 2500)
        + witmotion(0x53, 100, 200, 300, 0)
        + witmotion(0x59, 32700, 10, number % 20, 30)
    )
    return left, right, imu


def main() -> None:
    """Arguments: descriptors of left, right and trunk, then seconds."""
    *descriptors, seconds = (int(word) for word in sys.argv[1:5])
    began = time.monotonic()
    for number in range(RATE_HZ * seconds):
        time.sleep(max(0.0, began + number / RATE_HZ - time.monotonic()))
        for descriptor, data in zip(descriptors, frames(number), strict=True):
            os.write(descriptor, data)


if __name__ == "__main__":
    main()
