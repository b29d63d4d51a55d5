"""The modes of operation as one table."""

from hil_sim.drive.modes.cyclic import CyclicPosition, CyclicTorque, CyclicVelocity
from hil_sim.drive.modes.homing import Homing
from hil_sim.drive.modes.mode import Mode, ModeNumber
from hil_sim.drive.modes.profile_position import ProfilePosition
from hil_sim.drive.modes.profile_torque import ProfileTorque
from hil_sim.drive.modes.profile_velocity import ProfileVelocity

MODES: dict[ModeNumber, type[Mode]] = {
    ModeNumber.PROFILE_POSITION: ProfilePosition,
    ModeNumber.PROFILE_VELOCITY: ProfileVelocity,
    ModeNumber.PROFILE_TORQUE: ProfileTorque,
    ModeNumber.HOMING: Homing,
    ModeNumber.CYCLIC_SYNCHRONOUS_POSITION: CyclicPosition,
    ModeNumber.CYCLIC_SYNCHRONOUS_VELOCITY: CyclicVelocity,
    ModeNumber.CYCLIC_SYNCHRONOUS_TORQUE: CyclicTorque,
}
