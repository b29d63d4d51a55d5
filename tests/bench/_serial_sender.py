"""Child of the sensor benchmark: two insoles and a WitMotion IMU at 200 Hz on three open terminals."""

import os
import sys
import time

from tests.unit.imu.encode import witmotion
from tests.unit.insole.encode import RIGHT, cobs_frame

RATE_HZ = 200


def main() -> None:
    """Arguments: descriptors of left, right and trunk, then seconds."""
    left, right, trunk, seconds = (int(word) for word in sys.argv[1:5])
    began = time.monotonic()
    for number in range(RATE_HZ * seconds):
        time.sleep(max(0.0, began + number / RATE_HZ - time.monotonic()))
        for descriptor, flags in ((left, 0), (right, RIGHT)):
            sent_us = time.monotonic_ns() // 1000 & 0xFFFFFFFF
            cells = [sent_us & 0xFFFF, sent_us >> 16, *(100 + (number + cell) % 50 for cell in range(14))]
            os.write(descriptor, cobs_frame(cells, flags=flags, sequence=number, time_us=number * 5000))
        os.write(
            trunk,
            witmotion(0x51, number % 50, -30, 2048, 2500)
            + witmotion(0x52, 5, -5, number % 9, 2500)
            + witmotion(0x53, 100, 200, 300, 0)
            + witmotion(0x59, 32700, 10, number % 20, 30),
        )


if __name__ == "__main__":
    main()
