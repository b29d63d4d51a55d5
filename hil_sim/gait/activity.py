"""Activities that a wearer can be told to do, and labels of those actually done."""

from enum import IntEnum, StrEnum


class Activity(IntEnum):
    """Activity that the wearer is told to do (object 2005h of the gait controller)."""

    STAND = 0
    WALK = 1
    SIT = 2
    STAIRS_UP = 3
    STAIRS_DOWN = 4
    RAMP_UP = 5
    RAMP_DOWN = 6
    TURN_LEFT = 7
    TURN_RIGHT = 8
    STUMBLE = 9  # once, while walking; then walks on
    FALL = 10  # once, then lies; what is wanted next gets up first


class Label(StrEnum):
    """Activity that the wearer does at a moment, as named in the ground truth."""

    STAND = "stand"
    WALK = "walk"
    SIT = "sit"
    STAIRS_UP = "stairs_up"
    STAIRS_DOWN = "stairs_down"
    RAMP_UP = "ramp_up"
    RAMP_DOWN = "ramp_down"
    TURN_LEFT = "turn_left"
    TURN_RIGHT = "turn_right"
    STUMBLE = "stumble"
    FALL = "fall"
    STAND_TO_SIT = "stand_to_sit"
    SIT_TO_STAND = "sit_to_stand"
    LYING = "lying"
    GET_UP = "get_up"
