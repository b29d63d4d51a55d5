"""A drive's parameters in SI at the joint (rad, s, N·m), read anew after one of their objects was written."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from hil_sim.drive import objects as od
from hil_sim.drive.objects import Objects
from hil_sim.node.dictionary import Entry, Key, Value

_GRAM_SQUARE_CENTIMETRE = 1e-7  # kg·m²
_TRIP = 1.25  # of the peak current: where the power stage switches itself off
_NOT_WATCHED = (0, 0xFFFF_FFFF)  # 6065h and 6067h; 0 is what vendors' files say


class Control(Enum):
    """The closed loop."""

    POSITION = "position"
    VELOCITY = "velocity"
    TORQUE = "torque"

    __hash__ = object.__hash__  # each is one object, looked up in every cycle


@dataclass(frozen=True, slots=True)
class Gains:
    """One law for all loops, of a position error e and a velocity error d: stiffness·e + damping·d + ∫.

    In velocity control the position error is the integral of d, so that its integral gain is the stiffness;
    `reach` is how large the position error may become there (anti-windup).
    """

    stiffness: float = 0.0  # N·m/rad
    damping: float = 0.0  # N·m·s/rad
    integral: float = 0.0  # N·m/(rad·s)
    integral_limit: float = 0.0  # N·m
    feed_forward: float = 1.0  # share of the demanded velocity that the damping sees
    reach: float = math.inf  # rad


@dataclass(frozen=True, slots=True)
class Window:
    """Size and time of a window."""

    size: float
    time_s: float


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings in the drive's objects, which the comments name."""

    counts_per_radian: float  # 608Fh, 6091h
    gear: float
    rated_torque: float  # 6076h
    gains: dict[Control, Gains]  # 2030h, 2031h
    velocity_filter_s: float  # 2033h
    current_gain: float  # 2032h: share of the error that one step corrects
    highest_torque: float  # the least of 6072h, 6073h, 60E0h and the peak current 2040h:3
    lowest_torque: float  # with 60E1h
    trip_torque: float  # beyond the peak current
    back_emf: float  # V·s/rad, from 6075h and 6076h
    torque_per_volt: float  # with 2040h:1
    rotor_inertia: float  # kg·m² through the gear, 2040h:2
    winding_time_s: float  # 2040h:4
    housing_time_s: float
    top_speed: float  # 6080h
    profile_velocity: float  # 6081h, at most 607Fh
    max_velocity: float  # 607Fh, 6080h
    acceleration: float  # 6083h, at most 60C5h
    deceleration: float  # 6084h, at most 60C6h
    quick_stop_deceleration: float  # 6085h, at most 60C6h
    torque_slope: float  # N·m/s, 6087h
    low_limit: float  # 607Dh
    high_limit: float
    following: Window  # 6065h, 6066h
    position_window: Window  # 6067h, 6068h
    velocity_window: Window  # 606Dh, 606Eh
    velocity_threshold: Window  # 606Fh, 6070h
    interpolation_s: float  # 60C2h
    home_offset: float  # 607Ch
    homing_switch_speed: float  # 6099h
    homing_zero_speed: float
    homing_acceleration: float  # 609Ah


def read(objects: Objects) -> Settings:
    """Return the settings as the dictionary holds them now."""
    number, positive = objects.number, objects.positive
    gear = positive(od.GEAR_MOTOR_REVOLUTIONS) / positive(od.GEAR_SHAFT_REVOLUTIONS)
    counts = positive(od.ENCODER_INCREMENTS) / positive(od.ENCODER_REVOLUTIONS) * gear / math.tau
    rated_current = positive(od.RATED_CURRENT) / 1000.0
    torque_constant = positive(od.RATED_TORQUE) / 1000.0 * gear / rated_current
    rated_torque = torque_constant * rated_current
    peak_torque = number(od.PEAK_CURRENT) / 1000.0 * torque_constant
    top_speed = number(od.MAX_MOTOR_SPEED) * math.tau / 60.0 / gear

    def radians(key: Key) -> float:
        return number(key) / counts

    def at_most(key: Key, most: Key) -> float:
        return min(positive(key), positive(most)) / counts

    def torque(*keys: Key) -> float:
        return min(peak_torque, *(number(key) / 1000.0 * rated_torque for key in keys))

    def limits(low: Key, high: Key) -> tuple[float, float]:
        """None where they are equal, as in vendors' files."""
        return (radians(low), radians(high)) if number(low) < number(high) else (-math.inf, math.inf)

    def window(size: Key, time: Key) -> Window:
        watched = number(size) not in _NOT_WATCHED
        return Window(radians(size) if watched else math.inf, number(time) / 1000.0)

    low_limit, high_limit = limits(od.MIN_POSITION_LIMIT, od.MAX_POSITION_LIMIT)
    return Settings(
        counts_per_radian=counts,
        gear=gear,
        rated_torque=rated_torque,
        gains=_gains(number, rated_torque),
        velocity_filter_s=number(od.VELOCITY_FILTER) / 1e6,
        current_gain=number(od.CURRENT_GAIN) / 1000.0,
        highest_torque=torque(od.MAX_TORQUE, od.MAX_CURRENT, od.POSITIVE_TORQUE_LIMIT),
        lowest_torque=-torque(od.MAX_TORQUE, od.MAX_CURRENT, od.NEGATIVE_TORQUE_LIMIT),
        trip_torque=_TRIP * peak_torque,
        back_emf=torque_constant,
        torque_per_volt=torque_constant / (positive(od.WINDING_RESISTANCE) / 1000.0),
        rotor_inertia=number(od.ROTOR_INERTIA) * _GRAM_SQUARE_CENTIMETRE * gear * gear,
        winding_time_s=positive(od.WINDING_TIME),
        housing_time_s=positive(od.HOUSING_TIME),
        top_speed=top_speed,
        profile_velocity=at_most(od.PROFILE_VELOCITY, od.MAX_PROFILE_VELOCITY),
        max_velocity=min(radians(od.MAX_PROFILE_VELOCITY), top_speed),
        acceleration=at_most(od.PROFILE_ACCELERATION, od.MAX_ACCELERATION),
        deceleration=at_most(od.PROFILE_DECELERATION, od.MAX_DECELERATION),
        quick_stop_deceleration=at_most(od.QUICK_STOP_DECELERATION, od.MAX_DECELERATION),
        torque_slope=number(od.TORQUE_SLOPE) / 1000.0 * rated_torque,
        low_limit=low_limit,
        high_limit=high_limit,
        following=window(od.FOLLOWING_ERROR_WINDOW, od.FOLLOWING_ERROR_TIMEOUT),
        position_window=window(od.POSITION_WINDOW, od.POSITION_WINDOW_TIME),
        velocity_window=window(od.VELOCITY_WINDOW, od.VELOCITY_WINDOW_TIME),
        velocity_threshold=window(od.VELOCITY_THRESHOLD, od.VELOCITY_THRESHOLD_TIME),
        interpolation_s=positive(od.INTERPOLATION_TIME) * 10.0 ** number(od.INTERPOLATION_EXPONENT),
        home_offset=radians(od.HOME_OFFSET),
        homing_switch_speed=radians(od.HOMING_SWITCH_SPEED),
        homing_zero_speed=radians(od.HOMING_ZERO_SPEED),
        homing_acceleration=at_most(od.HOMING_ACCELERATION, od.MAX_ACCELERATION),
    )


def _gains(number: Callable[[Key], int], rated_torque: float) -> dict[Control, Gains]:
    stiffness = number(od.VELOCITY_INTEGRAL)
    windup = number(od.VELOCITY_INTEGRAL_LIMIT) / 1000.0 * rated_torque
    return {
        Control.POSITION: Gains(
            stiffness=number(od.POSITION_GAIN),
            damping=number(od.POSITION_DAMPING),
            integral=number(od.POSITION_INTEGRAL),
            integral_limit=number(od.POSITION_INTEGRAL_LIMIT) / 1000.0 * rated_torque,
            feed_forward=number(od.VELOCITY_FEED_FORWARD) / 1000.0,
        ),
        Control.VELOCITY: Gains(
            stiffness=stiffness,
            damping=number(od.VELOCITY_GAIN),
            reach=windup / stiffness if stiffness else 0.0,
        ),
        Control.TORQUE: Gains(reach=0.0),
    }


class Parameters:
    """Keeps the settings as they are `now`, until a write changes one of the objects.

    It watches every writable object of the profile and manufacturer ranges that nobody else does.
    """

    def __init__(self, objects: Objects) -> None:
        self._objects = objects
        self._changed = False
        self.now = read(objects)
        for entry in objects.dictionary:
            if entry.writable and entry.key[0] >= 0x2000 and entry.on_write is None:
                entry.on_write = self._watcher(entry)
                entry.on_written = self._refresh

    def _watcher(self, entry: Entry) -> Callable[[Value], None]:
        def taken(value: Value) -> None:
            self._changed = value != entry.value

        return taken

    def _refresh(self) -> None:
        if self._changed:
            self.now = read(self._objects)

    def reset(self) -> None:
        """All objects may have changed."""
        self.now = read(self._objects)
