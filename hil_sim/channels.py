"""A gateway's channels of the simulated robot, with the noise and resolution of the sensors.

Joints as their drives count them, insoles as `insole-cobs` and the trunk as `witmotion` send them. An insole
without load has no centre of pressure (None).
"""

import math

from hil_sim.drive import objects
from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.sensors.imus import witmotion
from hil_sim.sensors.insoles import insole_cobs
from hil_sim.sensors.sole import Pressures
from hil_sim.sensors.suite import FEET, TRUNK
from hil_sim.sensors.trunk_imu import Motion
from hil_sim.truth import CONTACT_N

UNITS = {
    **{f"{joint}.position": "rad" for joint in JOINTS},
    **{f"{joint}.velocity": "rad/s" for joint in JOINTS},
    **{
        f"{foot}.{name}": unit
        for foot in FEET
        for name, unit in (("force", "N"), ("cop_x", "m"), ("cop_y", "m"))
    },
    **{f"{TRUNK}.acceleration_{axis}": "m/s²" for axis in "xyz"},
    **{f"{TRUNK}.angular_velocity_{axis}": "rad/s" for axis in "xyz"},
    f"{TRUNK}.tilt_forward": "rad",
    f"{TRUNK}.tilt_side": "rad",
}

JOINT_UNITS = {  # what a joint tells beside its motion
    f"{joint}.{name}": unit
    for name, unit in (("torque", "N·m"), ("following_error", "rad"), ("temperature", "°C"))
    for joint in JOINTS
}

Values = list[float | None]


def reported(robot: Exoskeleton) -> Values:
    """Return the values of all channels now, in the order of `UNITS`; after the sensors' first cycle."""
    drives, sensors = list(zip(robot.drives.values(), robot.mountings.values(), strict=True)), robot.sensors
    return [
        *(
            mounting.angle(drive.dictionary[objects.POSITION_ACTUAL].number(), drive.counts_per_radian)
            for drive, mounting in drives
        ),
        *(
            mounting.seen(drive.dictionary[objects.VELOCITY_ACTUAL].number() / drive.counts_per_radian)
            for drive, mounting in drives
        ),
        *(value for side, pressures in enumerate(sensors.pressures) for value in _load(side, pressures)),
        *_trunk(sensors.motion),
    ]


def joints_reported(robot: Exoskeleton) -> list[float]:
    """Return the values of `JOINT_UNITS` now, in their order."""
    drives = list(zip(robot.drives.values(), robot.mountings.values(), strict=True))
    torques = [
        mounting.seen(
            drive.servo.settings.rated_torque * drive.dictionary[objects.TORQUE_ACTUAL].number() / 1e3
        )
        for drive, mounting in drives
    ]
    errors = [
        mounting.seen(drive.dictionary[objects.FOLLOWING_ERROR_ACTUAL].number() / drive.counts_per_radian)
        for drive, mounting in drives
    ]
    heat = [drive.dictionary[objects.MOTOR_TEMPERATURE].number() / 10.0 for drive, _ in drives]
    return [*torques, *errors, *heat]


def _load(side: int, pressures: Pressures) -> Values:
    outward = 1.0 - 2.0 * side  # the layout is that of a left foot
    newtons = [
        round(pascal / insole_cobs.UNIT_PA) * insole_cobs.UNIT_PA * cell.area
        for pascal, cell in zip(pressures.pascal, insole_cobs.CELLS, strict=True)
    ]
    force = sum(newtons)
    if force < CONTACT_N:
        return [force, None, None]
    shares = [(newton / force, cell) for newton, cell in zip(newtons, insole_cobs.CELLS, strict=True)]
    return [
        force,
        sum(share * cell.x for share, cell in shares),
        outward * sum(share * cell.y for share, cell in shares),
    ]


def _trunk(motion: Motion) -> Values:
    words = witmotion.vectors(motion)
    acceleration, rate, (roll, pitch, _) = (
        [word / witmotion.SCALES[kind] for word in words[kind]]
        for kind in (witmotion.ACCELERATION, witmotion.ANGULAR_RATE, witmotion.ANGLE)
    )
    return [*acceleration, *rate, pitch, -math.asin(math.sin(roll) * math.cos(pitch))]
