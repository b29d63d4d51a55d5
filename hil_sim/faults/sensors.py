"""Faults of one sensor: its plug, its settings, its cells. The switches are `hil_sim.sensors.faults`."""

import math
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager

from hil_sim.faults.fault import Fault, FaultRefused, FaultTarget, Form, Number, Site
from hil_sim.sensors.suite import FEET

Act = Callable[[Site], AbstractContextManager[None]]


def _yes(_site: Site) -> object:
    return True


def _share(site: Site) -> object:
    return site.number("percent") / 100.0


def _switched(switch: str, value: Callable[[Site], object] = _yes) -> Act:
    """Return a fault that sets one switch of the sensor."""

    @contextmanager
    def act(site: Site) -> Iterator[None]:
        faults = site.robot.sensors.faults[site.device]
        before = getattr(faults, switch)
        setattr(faults, switch, value(site))
        yield
        setattr(faults, switch, before)

    return act


def _on_line(act: Act) -> Act:
    """Return the same, where the sensor is on a serial line."""

    def checked(site: Site) -> AbstractContextManager[None]:
        if site.device not in site.robot.sensors.lines:
            raise FaultRefused(f"{site.device} is on the CAN bus here and has no serial line to disturb")
        return act(site)

    return checked


@contextmanager
def _swapped_feet(site: Site) -> Iterator[None]:
    faults = [site.robot.sensors.insole_faults[name] for name in FEET]
    for one in faults:
        one.swapped = True
    yield
    for one in faults:
        one.swapped = False


@contextmanager
def _swapped_ports(site: Site) -> Iterator[None]:
    left, right = (site.robot.sensors.lines[name] for name in FEET)
    left.port, right.port = right.port, left.port
    yield
    left.port, right.port = right.port, left.port


FAULTS = {
    "sensor_unplugged": Fault(
        FaultTarget.SENSOR,
        _switched("unplugged"),
        "The port hangs up and its name is gone; plugged in again, the sensor starts and counts anew.",
    ),
    "sensor_garbage": Fault(
        FaultTarget.SENSOR,
        _on_line(_switched("garbage_share", _share)),
        "Some of the bytes are others: checksums fail, frames are missing; at 100 % there is only noise.",
        {"percent": Number(100.0, 0.01, 100.0, "%", "share of the bytes that arrive as noise")},
    ),
    "sensor_wrong_baud": Fault(
        FaultTarget.SENSOR,
        _on_line(_switched("wrong_baud", lambda site: site.whole("baudrate"))),
        "Other bytes come, and not as many: what a receiver makes of bits that are too long or too short.",
        {"baudrate": Number(57_600, 1200, 4_000_000, "baud", "at which the sensor sends", Form.WHOLE)},
    ),
    "sensor_frozen": Fault(
        FaultTarget.SENSOR,
        _switched("frozen"),
        "Good frames that go on counting, with the same measured values again and again.",
    ),
    "sensor_dropout": Fault(
        FaultTarget.SENSOR,
        _on_line(_switched("dropout_share", _share)),
        "Some frames never come; where the sensor counts them, its own numbers show the gaps.",
        {"percent": Number(20.0, 0.01, 100.0, "%", "share of the frames that are not sent")},
    ),
    "insole_stuck_cell": Fault(
        FaultTarget.INSOLE,
        _switched("stuck_cell", lambda site: site.whole("cell")),
        "One cell says the same pressure always, foot on the ground or in the air.",
        {"cell": Number(5, 0, 63, "", "which cell, counted from 0", Form.WHOLE)},
    ),
    "insole_drift": Fault(
        FaultTarget.INSOLE,
        _switched("drift", lambda site: site.number("kpa_per_s") * 1000.0),
        "Every cell reads more from second to second, also in the air.",
        {"kpa_per_s": Number(2.0, -50.0, 50.0, "kPa/s", "by which each cell drifts")},
    ),
    "insole_saturated": Fault(
        FaultTarget.INSOLE,
        _switched("saturated"),
        "Pressures end at a ceiling far too low, and the frame's flag says so (bit 2 of the COBS format).",
    ),
    "imu_drift": Fault(
        FaultTarget.IMU,
        _switched("drift", lambda site: math.radians(site.number("deg_per_s"))),
        "Pitch runs away while the acceleration still points to the true down.",
        {"deg_per_s": Number(1.0, -100.0, 100.0, "°/s", "what the gyro about the side axis reads too much")},
    ),
    "imu_saturated": Fault(
        FaultTarget.IMU,
        _switched("clipped_at", lambda site: site.number("limit")),
        "No axis of the acceleration goes beyond the limit: at rest less than 9.8 m/s² in all.",
        {"limit": Number(6.0, 0.1, 1000.0, "m/s²", "where each axis ends")},
    ),
    "swapped_feet": Fault(
        FaultTarget.FEET,
        _swapped_feet,
        "Each insole lies in the other shoe: the left one is loaded while the left hip swings.",
    ),
    "swapped_ports": Fault(
        FaultTarget.FEET,
        _swapped_ports,
        "Each insole is plugged in where the other belongs: frames of the other foot come on each port.",
    ),
}
