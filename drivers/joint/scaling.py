"""Counts to SI, once: what the integrator says, completed by and checked against what the drive says."""

import math
from collections.abc import Callable, Mapping

from drivers.bus.fields import Linear
from drivers.joint.settings import JointSettings

# Object (axis 0) and sub-index of everything that the scaling reads from the drive, by its name here.
SCALING_OBJECTS: dict[str, tuple[int, int]] = {
    "rated_current_ma": (0x6075, 0),
    "rated_torque_mnm": (0x6076, 0),
    "encoder_increments": (0x608F, 1),
    "encoder_revolutions": (0x608F, 2),
    "gear_motor_revolutions": (0x6091, 1),
    "gear_shaft_revolutions": (0x6091, 2),
    "velocity_unit": (0x60A9, 0),
}

_RPM: dict[str, float] = {"rpm": 1, "0.1rpm": 0.1, "0.01rpm": 0.01, "0.001rpm": 0.001}
# 60A9h (CiA 402-2 "SI unit velocity"): prefix, then numerator 1 revolution (B4h) per minute (47h).
_VELOCITY_UNITS = {0x00B4_4700: "rpm", 0xFFB4_4700: "0.1rpm", 0xFEB4_4700: "0.01rpm", 0xFDB4_4700: "0.001rpm"}

TOLERANCE = 0.01  # two figures that differ by less agree
LEAST_EFFICIENCY = 0.4  # of a gear: torque at the joint may be this part of motor torque times ratio

Readings = Mapping[str, float | None]


def drive_speed(rad_s: float, counts_per_turn: float, gear_ratio: float, unit: int | None) -> float | None:
    """Return a joint speed in the drive's unit of velocity (60A9h); `None` if that is unknown.

    `counts_per_turn` are those of the joint. Without 60A9h, or with 0 there, it is counts/s (CiA 402-2).
    """
    if not unit:
        return rad_s * counts_per_turn / math.tau
    factor = _RPM.get(_VELOCITY_UNITS.get(unit, ""))
    return None if factor is None else rad_s * gear_ratio * 60 / math.tau / factor


def scalings(settings: JointSettings, readings: Readings) -> dict[str, Linear | None]:
    """Return the scaling of each quantity to SI; `None` for an unknown one, which then has no value."""
    rad_per_count = settings.rad_per_count
    rad_per_rpm = settings.direction * math.tau / 60 / settings.gear_ratio
    factor = _RPM.get(settings.velocity_unit)
    return {
        "position": Linear(rad_per_count, settings.zero_offset),
        "following_error": Linear(rad_per_count),
        "velocity": Linear(rad_per_count if factor is None else factor * rad_per_rpm),
        "torque": _per_mille(settings.direction, rated_torque(settings, readings)),
        "current": _per_mille(settings.direction, rated_current(settings, readings)),
    }


def rated_torque(settings: JointSettings, readings: Readings) -> float | None:
    """N·m at the joint: as configured, else the motor's 6076h times the gear ratio (a gear without loss)."""
    motor_mnm = readings.get("rated_torque_mnm")
    return settings.rated_torque or (motor_mnm / 1000 * settings.gear_ratio if motor_mnm else None)


def rated_current(settings: JointSettings, readings: Readings) -> float | None:
    """Return A, as configured, else by 6075h."""
    motor_ma = readings.get("rated_current_ma")
    return settings.rated_current or (motor_ma / 1000 if motor_ma else None)


def contradictions(settings: JointSettings, readings: Readings) -> tuple[str, ...]:
    """Return the contradictions between configuration and drive, in words."""
    found = (check(settings, readings) for check in _CHECKS)
    return tuple(text for text in found if text is not None)


def _per_mille(direction: int, rated: float | None) -> Linear | None:
    return None if rated is None else Linear(direction * rated / 1000)


def _ratio(readings: Readings, above: str, below: str) -> float | None:
    numerator, denominator = readings.get(above), readings.get(below)
    return numerator / denominator if numerator and denominator else None


def _differ(one: float, other: float) -> bool:
    return abs(one - other) > TOLERANCE * max(abs(one), abs(other))


def _check_encoder(settings: JointSettings, readings: Readings) -> str | None:
    device = _ratio(readings, "encoder_increments", "encoder_revolutions")
    # 1:1 is what drives hold that were never told of their encoder.
    if device is None or device == 1 or not _differ(device, settings.counts_per_revolution):
        return None
    return (
        f"counts_per_revolution is {settings.counts_per_revolution:g}, but the drive's 608Fh says "
        f"{device:g}: angles may be wrong by that ratio"
    )


def _check_gear(settings: JointSettings, readings: Readings) -> str | None:
    device = _ratio(readings, "gear_motor_revolutions", "gear_shaft_revolutions")
    # 1:1 is what drives hold that do not know their gear.
    if device is None or device == 1 or not _differ(device, settings.gear_ratio):
        return None
    return (
        f"gear_ratio is {settings.gear_ratio:g}, but the drive's 6091h says {device:g}: angles may be wrong"
    )


def _check_torque(settings: JointSettings, readings: Readings) -> str | None:
    motor_mnm = readings.get("rated_torque_mnm")
    if settings.rated_torque is None or not motor_mnm:
        return None
    lossless = motor_mnm / 1000 * settings.gear_ratio
    if LEAST_EFFICIENCY * lossless <= settings.rated_torque <= (1 + TOLERANCE) * lossless:
        return None
    return (
        f"rated_torque is {settings.rated_torque:g} N·m, but the drive's 6076h times gear_ratio makes "
        f"{lossless:g} N·m: torques may be wrong by that ratio"
    )


def _check_current(settings: JointSettings, readings: Readings) -> str | None:
    motor_ma = readings.get("rated_current_ma")
    if settings.rated_current is None or not motor_ma or not _differ(motor_ma / 1000, settings.rated_current):
        return None
    return f"rated_current is {settings.rated_current:g} A, but the drive's 6075h says {motor_ma / 1000:g} A"


def _check_velocity_unit(settings: JointSettings, readings: Readings) -> str | None:
    device = _VELOCITY_UNITS.get(int(readings.get("velocity_unit") or 0))
    if device is None or device == settings.velocity_unit:
        return None
    return f'velocity_unit is "{settings.velocity_unit}", but the drive\'s 60A9h says "{device}"'


_CHECKS: tuple[Callable[[JointSettings, Readings], str | None], ...] = (
    _check_encoder,
    _check_gear,
    _check_torque,
    _check_current,
    _check_velocity_unit,
)
