"""Self-supervision of a drive: supply, current, heat and following error, with the codes of 603Fh.

Error codes of CiA 402-2 table 17 and CiA 301 table 26.
"""

from hil_sim.drive.servo import Servo

OVERCURRENT = 0x2310
OVERVOLTAGE = 0x3210
UNDERVOLTAGE = 0x3220
OVERTEMPERATURE = 0x4310
COMMUNICATION = 0x8100
FOLLOWING_ERROR = 0x8611

# After these the power stage is off: no ramp can follow.
CURRENT_GONE = frozenset({OVERCURRENT, OVERVOLTAGE})

NOMINAL_SUPPLY_V = 48.0
LOWEST_SUPPLY_V, HIGHEST_SUPPLY_V = 36.0, 60.0
_SUPPLY_WARNING_V = 40.0
_HOUSING_WARNING_C, _HOUSING_FAULT_C = 85.0, 100.0
_WINDING_WARNING_C, _WINDING_FAULT_C = 110.0, 125.0
_LOAD_WARNING = 0.9  # of I²t


def trouble(servo: Servo, supply_v: float, live: bool) -> int | None:
    """Return the present error, if any; supply and current count where the power stage is `live`."""
    thermal = servo.thermal
    if thermal.housing_c > _HOUSING_FAULT_C or thermal.winding_c > _WINDING_FAULT_C:
        return OVERTEMPERATURE
    if live and supply_v < LOWEST_SUPPLY_V:
        return UNDERVOLTAGE
    if live and supply_v > HIGHEST_SUPPLY_V:
        return OVERVOLTAGE
    if abs(servo.torque) > servo.settings.trip_torque:
        return OVERCURRENT
    return None


def warning(servo: Servo, supply_v: float) -> bool:
    """Bit 7 of the statusword: an error is near."""
    thermal = servo.thermal
    return (
        thermal.load > _LOAD_WARNING
        or thermal.housing_c > _HOUSING_WARNING_C
        or thermal.winding_c > _WINDING_WARNING_C
        or supply_v < _SUPPLY_WARNING_V
    )


class FollowingErrorWatch:
    """Timer of a following error beyond 6065h."""

    def __init__(self) -> None:
        self.late_s = 0.0

    def update(self, servo: Servo, watched: bool, elapsed_s: float) -> bool:
        """Return whether it has lasted longer than 6066h allows."""
        following = servo.settings.following
        late = watched and abs(servo.following_error) > following.size
        self.late_s = self.late_s + elapsed_s if late else 0.0
        return self.late_s > following.time_s
