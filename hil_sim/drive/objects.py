"""The objects of a joint drive by their names in CiA 402-2, and what counts where a file lacks one."""

from hil_sim.node.dictionary import Dictionary, Key

# The drive's own, in the manufacturer's range.
MOTOR_TEMPERATURE = (0x2010, 0)
WINDING_TEMPERATURE = (0x2011, 0)
MOTOR_LOAD = (0x2012, 0)
POSITION_GAIN = (0x2030, 1)
POSITION_DAMPING = (0x2030, 2)
POSITION_INTEGRAL = (0x2030, 3)
POSITION_INTEGRAL_LIMIT = (0x2030, 4)
VELOCITY_FEED_FORWARD = (0x2030, 5)
VELOCITY_GAIN = (0x2031, 1)
VELOCITY_INTEGRAL = (0x2031, 2)
VELOCITY_INTEGRAL_LIMIT = (0x2031, 3)
CURRENT_GAIN = (0x2032, 0)
VELOCITY_FILTER = (0x2033, 0)
WINDING_RESISTANCE = (0x2040, 1)
ROTOR_INERTIA = (0x2040, 2)
PEAK_CURRENT = (0x2040, 3)
WINDING_TIME = (0x2040, 4)
HOUSING_TIME = (0x2040, 5)

ABORT_CONNECTION_OPTION = (0x6007, 0)
ERROR_CODE = (0x603F, 0)
CONTROLWORD = (0x6040, 0)
STATUSWORD = (0x6041, 0)
QUICK_STOP_OPTION = (0x605A, 0)
SHUTDOWN_OPTION = (0x605B, 0)
DISABLE_OPERATION_OPTION = (0x605C, 0)
HALT_OPTION = (0x605D, 0)
FAULT_REACTION_OPTION = (0x605E, 0)
MODE = (0x6060, 0)
MODE_DISPLAY = (0x6061, 0)
POSITION_DEMAND = (0x6062, 0)
POSITION_ACTUAL = (0x6064, 0)
FOLLOWING_ERROR_WINDOW = (0x6065, 0)
FOLLOWING_ERROR_TIMEOUT = (0x6066, 0)
POSITION_WINDOW = (0x6067, 0)
POSITION_WINDOW_TIME = (0x6068, 0)
VELOCITY_DEMAND = (0x606B, 0)
VELOCITY_ACTUAL = (0x606C, 0)
VELOCITY_WINDOW = (0x606D, 0)
VELOCITY_WINDOW_TIME = (0x606E, 0)
VELOCITY_THRESHOLD = (0x606F, 0)
VELOCITY_THRESHOLD_TIME = (0x6070, 0)
TARGET_TORQUE = (0x6071, 0)
MAX_TORQUE = (0x6072, 0)
MAX_CURRENT = (0x6073, 0)
TORQUE_DEMAND = (0x6074, 0)
RATED_CURRENT = (0x6075, 0)
RATED_TORQUE = (0x6076, 0)
TORQUE_ACTUAL = (0x6077, 0)
CURRENT_ACTUAL = (0x6078, 0)
DC_LINK_VOLTAGE = (0x6079, 0)
TARGET_POSITION = (0x607A, 0)
HOME_OFFSET = (0x607C, 0)
MIN_POSITION_LIMIT = (0x607D, 1)
MAX_POSITION_LIMIT = (0x607D, 2)
POSITION_LIMITS = (MIN_POSITION_LIMIT, MAX_POSITION_LIMIT)
MAX_PROFILE_VELOCITY = (0x607F, 0)
MAX_MOTOR_SPEED = (0x6080, 0)
PROFILE_VELOCITY = (0x6081, 0)
PROFILE_ACCELERATION = (0x6083, 0)
PROFILE_DECELERATION = (0x6084, 0)
QUICK_STOP_DECELERATION = (0x6085, 0)
TORQUE_SLOPE = (0x6087, 0)
ENCODER_INCREMENTS = (0x608F, 1)
ENCODER_REVOLUTIONS = (0x608F, 2)
GEAR_MOTOR_REVOLUTIONS = (0x6091, 1)
GEAR_SHAFT_REVOLUTIONS = (0x6091, 2)
HOMING_METHOD = (0x6098, 0)
HOMING_SWITCH_SPEED = (0x6099, 1)
HOMING_ZERO_SPEED = (0x6099, 2)
HOMING_ACCELERATION = (0x609A, 0)
HOMING_METHODS = 0x60E3  # those that it has, from sub-index 1 on
POSITION_OFFSET = (0x60B0, 0)
VELOCITY_OFFSET = (0x60B1, 0)
TORQUE_OFFSET = (0x60B2, 0)
INTERPOLATION_TIME = (0x60C2, 1)
INTERPOLATION_EXPONENT = (0x60C2, 2)
MAX_ACCELERATION = (0x60C5, 0)
MAX_DECELERATION = (0x60C6, 0)
POSITIVE_TORQUE_LIMIT = (0x60E0, 0)
NEGATIVE_TORQUE_LIMIT = (0x60E1, 0)
FOLLOWING_ERROR_ACTUAL = (0x60F4, 0)
DIGITAL_INPUTS = (0x60FD, 0)
TARGET_VELOCITY = (0x60FF, 0)
SUPPORTED_MODES = (0x6502, 0)

_MANUFACTURER = range(0x2000, 0x6000)
_PRODUCT_CODE = (0x1018, 2)
_OUR_PRODUCT = 0x4A440001

# What a drive does that has no such object, or says 0 where 0 has no meaning: the values of joint_drive.eds,
# but for 6007h, where it is the standard's.
_OTHERWISE: dict[Key, int] = {
    POSITION_GAIN: 3000,
    POSITION_DAMPING: 100,
    POSITION_INTEGRAL: 0,
    POSITION_INTEGRAL_LIMIT: 500,
    VELOCITY_FEED_FORWARD: 1000,
    VELOCITY_GAIN: 100,
    VELOCITY_INTEGRAL: 1000,
    VELOCITY_INTEGRAL_LIMIT: 1000,
    CURRENT_GAIN: 250,
    VELOCITY_FILTER: 5000,
    WINDING_RESISTANCE: 500,
    ROTOR_INERTIA: 400,
    PEAK_CURRENT: 20_000,
    WINDING_TIME: 20,
    HOUSING_TIME: 600,
    ABORT_CONNECTION_OPTION: 1,
    QUICK_STOP_OPTION: 2,
    SHUTDOWN_OPTION: 0,
    DISABLE_OPERATION_OPTION: 1,
    HALT_OPTION: 1,
    FAULT_REACTION_OPTION: 2,
    MODE: 8,
    FOLLOWING_ERROR_WINDOW: 22_755,
    FOLLOWING_ERROR_TIMEOUT: 500,
    POSITION_WINDOW: 500,
    POSITION_WINDOW_TIME: 20,
    VELOCITY_WINDOW: 2000,
    VELOCITY_WINDOW_TIME: 20,
    VELOCITY_THRESHOLD: 500,
    VELOCITY_THRESHOLD_TIME: 20,
    TARGET_TORQUE: 0,
    MAX_TORQUE: 2000,
    MAX_CURRENT: 3000,
    RATED_CURRENT: 5000,
    RATED_TORQUE: 400,
    TARGET_POSITION: 0,
    HOME_OFFSET: 0,
    MIN_POSITION_LIMIT: -114_000,
    MAX_POSITION_LIMIT: 148_000,
    MAX_PROFILE_VELOCITY: 520_000,
    MAX_MOTOR_SPEED: 5000,
    PROFILE_VELOCITY: 65_190,
    PROFILE_ACCELERATION: 260_000,
    PROFILE_DECELERATION: 260_000,
    QUICK_STOP_DECELERATION: 1_300_000,
    TORQUE_SLOPE: 2000,
    ENCODER_INCREMENTS: 4096,
    ENCODER_REVOLUTIONS: 1,
    GEAR_MOTOR_REVOLUTIONS: 100,
    GEAR_SHAFT_REVOLUTIONS: 1,
    HOMING_METHOD: 0,
    HOMING_SWITCH_SPEED: 20_000,
    HOMING_ZERO_SPEED: 4000,
    HOMING_ACCELERATION: 260_000,
    POSITION_OFFSET: 0,
    VELOCITY_OFFSET: 0,
    TORQUE_OFFSET: 0,
    INTERPOLATION_TIME: 10,
    INTERPOLATION_EXPONENT: -3,
    MAX_ACCELERATION: 13_000_000,
    MAX_DECELERATION: 13_000_000,
    POSITIVE_TORQUE_LIMIT: 2500,
    NEGATIVE_TORQUE_LIMIT: 2500,
    TARGET_VELOCITY: 0,
    SUPPORTED_MODES: 0x3AD,
}

# What is built into the robot, whatever a vendor's file says of the motor that its makers thought of.
_BUILT_IN = frozenset(
    {
        ENCODER_INCREMENTS,
        ENCODER_REVOLUTIONS,
        GEAR_MOTOR_REVOLUTIONS,
        GEAR_SHAFT_REVOLUTIONS,
        RATED_CURRENT,
        RATED_TORQUE,
    }
)


class Objects:
    """The dictionary of a drive with its gaps filled; where the file gives no value, the object has ours.

    A vendor's manufacturer objects mean something else than ours: of them only our own drive's count.
    """

    def __init__(self, dictionary: Dictionary) -> None:
        self.dictionary = dictionary
        self._ours = _PRODUCT_CODE in dictionary and dictionary[_PRODUCT_CODE].value == _OUR_PRODUCT
        for key, value in _OTHERWISE.items():
            if self.has(key) and not dictionary[key].described:
                dictionary[key].default = dictionary[key].value = value
        self._counting = {entry.key: entry for entry in dictionary if self._counts(entry.key)}

    def has(self, key: Key) -> bool:
        return key in self.dictionary and (self._ours or key[0] not in _MANUFACTURER)

    def _counts(self, key: Key) -> bool:
        return self.has(key) and (self._ours or key not in _BUILT_IN)

    def number(self, key: Key) -> int:
        entry = self._counting.get(key)
        return _OTHERWISE[key] if entry is None else entry.number()

    def homing_methods(self) -> frozenset[int]:
        """Return those that 60E3h names; none where it names none."""
        keys = [key for key in self._counting if key[0] == HOMING_METHODS and key[1] > 0]
        return frozenset(number for key in keys if (number := self._counting[key].number()))

    def positive(self, key: Key) -> int:
        """Return a number that cannot be 0."""
        return self.number(key) or _OTHERWISE[key]
