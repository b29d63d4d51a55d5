"""Faults that begin small and grow, of drives and sensors: what somebody could see coming."""

import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from hil_sim.clock import MILLISECOND_NS
from hil_sim.drive import objects
from hil_sim.exoskeleton import JOINTS
from hil_sim.faults.fault import Fault, FaultTarget, Number, Site

_TICK_NS = 50 * MILLISECOND_NS
_TICK_S = _TICK_NS / 1e9
_SOFTEST = 0.05  # of its damping that an untuned drive is left with


@contextmanager
def _each_tick(site: Site, grow: Callable[[float], None]) -> Iterator[None]:
    """Call `grow` with the seconds since the fault began, until it ends."""
    began_s = site.robot.clock.now_s
    growing = site.robot.clock.every(_TICK_NS, lambda: grow(site.robot.clock.now_s - began_s))
    yield
    growing.cancel()


@contextmanager
def _friction_grows(site: Site) -> Iterator[None]:
    joint = site.drive.joint
    before = joint.friction_factor

    def grow(since_s: float) -> None:
        joint.friction_factor = before * (1.0 + site.number("times_per_s") * since_s)

    with _each_tick(site, grow):
        yield
    joint.friction_factor = before


@contextmanager
def _encoder_slips(site: Site) -> Iterator[None]:
    encoder, step = site.drive.encoder, math.radians(site.number("degrees")) * site.drive.counts_per_radian
    before = encoder.offset_counts

    def slip(since_s: float) -> None:
        encoder.offset_counts = before + round(step) * int(since_s / site.number("every_s"))

    with _each_tick(site, slip):
        yield
    encoder.offset_counts = before


@contextmanager
def _torque_fades(site: Site) -> Iterator[None]:
    servo = site.drive.servo

    def fade(since_s: float) -> None:
        servo.strength = max(1.0 - site.number("percent_per_s") / 100.0 * since_s, 0.0)

    with _each_tick(site, fade):
        yield
    servo.strength = 1.0


@contextmanager
def _oscillation(site: Site) -> Iterator[None]:
    gain, damping = (site.drive.dictionary[key] for key in (objects.POSITION_GAIN, objects.POSITION_DAMPING))
    before = gain.number(), damping.number()

    def grow(since_s: float) -> None:
        share = min(site.number("percent_per_s") / 100.0 * since_s, 1.0)
        gain.take(round(before[0] * (1.0 + share)))
        damping.take(round(before[1] * max(1.0 - share, _SOFTEST)))

    with _each_tick(site, grow):
        yield
    gain.take(before[0])
    damping.take(before[1])


@contextmanager
def _resists(site: Site) -> Iterator[None]:
    resists, joint = site.robot.wearer.resists, list(JOINTS).index(site.device)

    def pull(since_s: float) -> None:
        beat = 0.5 - 0.5 * math.cos(math.tau * site.number("hertz") * since_s)
        resists[joint] = site.number("nm_per_s") * since_s * beat

    with _each_tick(site, pull):
        yield
    resists.pop(joint, None)


@contextmanager
def _cells_die(site: Site) -> Iterator[None]:
    dead = site.robot.sensors.insole_faults[site.device].dead_cells
    order = list(range(site.whole("cells")))
    site.random.shuffle(order)

    def die(since_s: float) -> None:
        dead.update(order[: int(since_s / site.number("every_s"))])

    with _each_tick(site, die):
        yield
    dead.clear()


@contextmanager
def _mount_slips(site: Site) -> Iterator[None]:
    faults, clock = site.robot.sensors.imu_faults, site.robot.clock
    step = math.radians(site.number("deg_per_s")) * 0.01

    def slip() -> None:
        faults.slipped += step

    slipping = clock.every(10 * MILLISECOND_NS, slip)
    yield
    slipping.cancel()
    faults.slipped = 0.0


FAULTS = {
    "friction_grows": Fault(
        FaultTarget.DRIVE,
        _friction_grows,
        "Torque grows with speed from stride to stride, then 60F4h; at last as following_error.",
        {"times_per_s": Number(0.4, 0.01, 100.0, "1/s", "of the usual friction, more each second")},
    ),
    "encoder_slips": Fault(
        FaultTarget.DRIVE,
        _encoder_slips,
        "6064h jumps a little, again and again; each time the drive moves the joint by as much.",
        {
            "degrees": Number(0.7, -5.0, 5.0, "°", "of each slip, seen at the joint"),
            "every_s": Number(0.5, 0.05, 60.0, "s", "from one slip to the next"),
        },
    ),
    "torque_fades": Fault(
        FaultTarget.DRIVE,
        _torque_fades,
        "6077h grows for the same motion: the current makes less torque; then 60F4h grows too.",
        {"percent_per_s": Number(10.0, 0.1, 1000.0, "%/s", "of its torque that is lost")},
    ),
    "oscillation": Fault(
        FaultTarget.DRIVE,
        _oscillation,
        "606Ch and 6077h tremble faster than anybody moves, more and more: the loop is badly tuned.",
        {"percent_per_s": Number(12.0, 0.1, 1000.0, "%/s", "by which its gain grows and its damping falls")},
    ),
    "wearer_resists": Fault(
        FaultTarget.DRIVE,
        _resists,
        "6077h beats some times a second, more and more: the wearer's muscles work against the joint.",
        {
            "nm_per_s": Number(12.0, -200.0, 200.0, "N·m/s", "by which the resistance grows"),
            "hertz": Number(4.0, 0.1, 9.0, "Hz", "at which it beats"),
        },
    ),
    "insole_cells_die": Fault(
        FaultTarget.INSOLE,
        _cells_die,
        "One cell after the other says nothing: the force falls, the centre of pressure moves away.",
        {
            "every_s": Number(0.6, 0.05, 600.0, "s", "from one cell to the next"),
            "cells": Number(16, 1, 64, "", "how many there are"),
        },
    ),
    "imu_slips": Fault(
        FaultTarget.IMU,
        _mount_slips,
        "Tilt, acceleration and rate turn forward together, as the IMU turns on the trunk.",
        {"deg_per_s": Number(1.5, -50.0, 50.0, "°/s", "how fast")},
    ),
}  # fmt: skip
