"""Two insoles and an IMU on pseudo-terminals, as a process: `python -m tests.attack._sensors DIR INSOLE IMU`.

It says `ready`, sends a hundred frames a second of each, and ends with its standard input. The line
`hostile NAME` makes the sensor of this name send what `on_serial.py` has instead, `hostile none` ends that.
"""

import select
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from hil_sim.sensors.serial_port import SerialPort
from hil_sim.sensors.suite import FEET, TRUNK
from tests.attack.on_serial import PERIOD_S, TICK_NS, healthy, hostile


class Sensor:
    """One sensor, and what it sends now."""

    def __init__(self, folder: Path, name: str, format_name: str) -> None:
        self._format = format_name
        baudrate, self._frames = healthy(format_name, right=name == FEET[1])
        self._hostile: Iterator[bytes] | None = None
        self.port = SerialPort(folder / name, baudrate)
        self._due = time.monotonic()

    def turn(self, on: bool) -> None:
        self._hostile = hostile(self._format) if on else None

    def send(self) -> float:
        """What is due; returns when the next is."""
        now = time.monotonic()
        if now >= self._due:
            self.port.write(next(self._frames if self._hostile is None else self._hostile))
            self._due = max(self._due, now - 0.1) + (TICK_NS / 1e9 if self._hostile is None else PERIOD_S)
        return self._due


def main(folder: Path, insole: str, imu: str) -> None:
    sensors = {name: Sensor(folder, name, insole) for name in FEET} | {TRUNK: Sensor(folder, TRUNK, imu)}
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    while True:
        wait_s = max(0.0, min(one.send() for one in sensors.values()) - time.monotonic())
        if select.select([sys.stdin], [], [], wait_s)[0]:
            line = sys.stdin.readline()
            if not line:
                break
            for name, sensor in sensors.items():
                sensor.turn(name == line.split()[1])
    for sensor in sensors.values():
        sensor.port.close()


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2], sys.argv[3])
