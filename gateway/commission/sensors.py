"""The steps of serial sensors: what talks on each port, which foot is which, how the IMU is mounted."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from drivers.errors import DriverError
from drivers.imu.rotation import Vector
from gateway.commission.axes import answered
from gateway.commission.axes_of_imu import NoAxes, axes
from gateway.commission.dialogue import Say, Talk, press
from gateway.commission.draft import Draft

FEET = ("left", "right")
CLEARLY = 1.5  # times as much as on the other foot's port
IMU = "imu.trunk"


@dataclass(frozen=True, slots=True)
class Sensor:
    """A sensor on a port: its format, its baud rate, whether it is an insole."""

    port: str
    baudrate: int
    format: str
    insole: bool
    layout: str | None = None  # of an insole whose format needs one


class SerialBench(Protocol):
    """The robot's serial ports while it is commissioned; each call raises `DriverError`."""

    def sensor(self, port: str) -> Sensor: ...

    def loads(self, insoles: Sequence[Sensor]) -> dict[str, float]:
        """Return the change of each insole's load in a second or two, by port; in any unit."""
        ...

    def up(self, imu: Sensor) -> Vector:
        """Return the direction of up in the sensor's axes, held still."""
        ...


def sensors(draft: Draft, bench: SerialBench, ports: Sequence[str]) -> Talk[None]:
    """Every port's sensor, then feet and trunk."""
    found: list[Sensor] = []
    for port in ports:
        try:
            one = bench.sensor(port)
        except DriverError as error:
            yield Say(f"{port} is left out: {error}")
            continue
        found.append(one)
        yield Say(f"{port}: {one.format} at {one.baudrate} baud")
    yield from _feet(draft, bench, [one for one in found if one.insole])
    for imu in [one for one in found if not one.insole][:1]:
        yield from _trunk(draft, bench, imu)


def _feet(draft: Draft, bench: SerialBench, insoles: Sequence[Sensor]) -> Talk[None]:
    left = list(insoles)
    for foot in FEET:
        table = f"insole.{foot}_insole"
        if draft.has(table, "port"):
            left = [one for one in left if one.port != draft.value(table, "port")]
        elif left:
            one, how = yield from _stamped(bench, foot, left)
            left.remove(one)
            draft.put(table, "baudrate", one.baudrate, "as it was heard")
            draft.put(table, "format", one.format, "as it was recognised")
            if one.layout is not None:
                draft.put(table, "layout", one.layout, "whose description fits")
            draft.put(table, "port", one.port, how)


def _stamped(bench: SerialBench, foot: str, insoles: Sequence[Sensor]) -> Talk[tuple[Sensor, str]]:
    while True:
        yield from press(f"Press Enter, and stamp with the {foot} foot for some seconds.")
        try:
            loads = bench.loads(insoles)
        except DriverError as error:
            yield Say(str(error))
            continue
        order = sorted(insoles, key=lambda one: loads[one.port], reverse=True)
        most, next_ = loads[order[0].port], loads[order[1].port] if len(order) > 1 else 0.0
        if most > 0 and most >= CLEARLY * next_:
            return order[0], f"stamped with the {foot} foot"
        yield Say("No insole has felt it clearly: stamp with that foot alone.")


def _trunk(draft: Draft, bench: SerialBench, imu: Sensor) -> Talk[None]:
    if draft.has(IMU, "axes"):
        return
    while True:
        ups = []
        for posture in (
            "Stand upright and still",
            "Lean forward by 20° or more, still",
            "Lean to your left, still",
        ):
            yield from press(f"{posture} (or hold the IMU's part of the trunk so).")
            ups.append((yield from answered(partial(bench.up, imu))))
        try:
            found = axes(*ups)
        except NoAxes as error:
            yield Say(f"{error}. Once more.")
            continue
        draft.put(IMU, "port", imu.port)
        draft.put(IMU, "baudrate", imu.baudrate, "as it was heard")
        draft.put(IMU, "format", imu.format, "as it was recognised")
        draft.put(IMU, "axes", list(found), "upright, forward and left were shown")
        yield Say(f"The trunk's forward, left and up are the sensor's {', '.join(found)}.")
        return
