"""Faults of one joint drive: electronics, encoder, gear, bearing."""

import math
from collections.abc import Iterator
from contextlib import contextmanager

from hil_sim.clock import MILLISECOND_NS
from hil_sim.drive.supervision import OVERCURRENT
from hil_sim.exoskeleton import JOINTS
from hil_sim.faults.fault import Fault, FaultTarget, Form, Number, Site

_HEATING_TICK_NS = 100 * MILLISECOND_NS
_STRAYING_TICK_NS = 10 * MILLISECOND_NS


@contextmanager
def _overcurrent(site: Site) -> Iterator[None]:
    site.drive.fault(OVERCURRENT)
    yield


@contextmanager
def _overtemperature(site: Site) -> Iterator[None]:
    drive = site.drive
    step_c = site.number("rate_c_per_s") * _HEATING_TICK_NS / 1e9

    def heat() -> None:
        drive.temperature_c = min(drive.temperature_c + step_c, max(site.number("to_c"), drive.temperature_c))

    heating = site.robot.clock.every(_HEATING_TICK_NS, heat)
    yield
    heating.cancel()


@contextmanager
def _undervoltage(site: Site) -> Iterator[None]:
    before, site.drive.supply_v = site.drive.supply_v, site.number("volts")
    yield
    site.drive.supply_v = before


@contextmanager
def _encoder_jump(site: Site) -> Iterator[None]:
    counts = round(math.radians(site.number("degrees")) * site.drive.counts_per_radian)
    site.drive.encoder.offset_counts += counts
    yield
    site.drive.encoder.offset_counts -= counts


@contextmanager
def _encoder_stuck(site: Site) -> Iterator[None]:
    site.drive.encoder.stuck = True
    yield
    site.drive.encoder.stuck = False


@contextmanager
def _gear_slip(site: Site) -> Iterator[None]:
    site.drive.joint.slip(math.radians(site.number("degrees")))
    yield


@contextmanager
def _friction(site: Site) -> Iterator[None]:
    joint, factor = site.drive.joint, site.number("factor")
    joint.friction_factor *= factor
    yield
    joint.friction_factor /= factor


@contextmanager
def _sto(site: Site) -> Iterator[None]:
    site.drive.power.take_torque(off=True)
    yield
    site.drive.power.take_torque(off=False)


@contextmanager
def _limit_switch(site: Site) -> Iterator[None]:
    bit = 1 << site.whole("bit")
    site.drive.inputs |= bit
    yield
    site.drive.inputs &= ~bit


@contextmanager
def _drift(site: Site) -> Iterator[None]:
    site.drive.joint.creep = math.radians(site.number("deg_per_s"))
    yield
    site.drive.joint.creep = 0.0


@contextmanager
def _runaway(site: Site) -> Iterator[None]:
    """Return the set-points go away, and come back as fast when it is over."""
    strays, number, clock = site.robot.controller.strays, list(JOINTS).index(site.device), site.robot.clock
    step = math.radians(site.number("deg_per_s")) * _STRAYING_TICK_NS / 1e9

    def go() -> None:
        strays[number] += step

    def come_back() -> None:
        left = strays[number] - step
        strays[number] = left if left * step > 0.0 else 0.0
        if not strays[number]:
            coming_back.cancel()

    going = clock.every(_STRAYING_TICK_NS, go)
    yield
    going.cancel()
    coming_back = clock.every(_STRAYING_TICK_NS, come_back)


_DEGREES = Number(5.0, -60.0, 60.0, "°", "how far, seen at the joint")

FAULTS = {
    "overcurrent": Fault(
        FaultTarget.DRIVE,
        _overcurrent,
        "EMCY 2310h with bit 1 of 1001h, 603Fh = 2310h; the state is fault reaction active, then fault.",
        momentary=True,
    ),
    "overtemperature": Fault(
        FaultTarget.DRIVE,
        _overtemperature,
        "The motor's temperature rises; above 100 °C EMCY 4310h with bit 3 of 1001h, and the state fault.",
        {
            "to_c": Number(110.0, 30.0, 150.0, "°C", "where the motor ends"),
            "rate_c_per_s": Number(20.0, 0.1, 1000.0, "°C/s", "how fast it gets hotter"),
        },
    ),
    "undervoltage": Fault(
        FaultTarget.DRIVE,
        _undervoltage,
        "Below 36 V an enabled drive sends EMCY 3220h with bit 2 of 1001h and goes to fault.",
        {"volts": Number(30.0, 0.0, 60.0, "V", "of the DC link")},
    ),
    "encoder_jump": Fault(
        FaultTarget.DRIVE,
        _encoder_jump,
        "6064h jumps from one PDO to the next, faster than a joint moves; the drive then moves it back.",
        {"degrees": _DEGREES},
    ),
    "encoder_stuck": Fault(
        FaultTarget.DRIVE,
        _encoder_stuck,
        "6064h stays the same to the count while 6062h moves on; beyond 6065h and 6066h EMCY 8611h, fault.",
    ),
    "gear_slip": Fault(
        FaultTarget.DRIVE,
        _gear_slip,
        "6064h shows nothing: the joint itself is off by the angle, until somebody homes it anew.",
        {"degrees": _DEGREES},
        momentary=True,
    ),
    "following_error": Fault(
        FaultTarget.DRIVE,
        _friction,
        "The joint is all but jammed: 60F4h and torque grow, then bit 13, after 6066h EMCY 8611h and fault.",
        {"factor": Number(60.0, 1.0, 1000.0, "", "how many times its friction")},
    ),
    "sto": Fault(
        FaultTarget.DRIVE,
        _sto,
        "Hardware takes the motor's power: switch on disabled, 60FDh bit 16; nothing enables it meanwhile.",
    ),
    "limit_switch": Fault(
        FaultTarget.DRIVE,
        _limit_switch,
        "A bit of 60FDh is set, wherever the joint is; the drive itself does nothing about it.",
        {"bit": Number(1, 0, 31, "", "0 and 1 the limit switches, 2 home, 3 interlock", Form.WHOLE)},
    ),
    "drift": Fault(
        FaultTarget.DRIVE,
        _drift,
        "6064h creeps while the motor has no power, as under a load that the gear does not hold.",
        {"deg_per_s": Number(2.0, -60.0, 60.0, "°/s", "how fast")},
    ),
    "runaway": Fault(
        FaultTarget.DRIVE,
        _runaway,
        "The controller's set-points for the joint go away and on; the drive follows up to its own limits.",
        {"deg_per_s": Number(200.0, -300.0, 300.0, "°/s", "how fast")},
    ),
}
