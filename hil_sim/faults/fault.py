"""Definition of a fault: its possible targets, its parameters, and its symptoms."""

import math
import os
import random
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

from hil_sim.drive.drive import JointDrive
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import CONTROLLER, JOINTS, SENSORS, Exoskeleton
from hil_sim.node.node import Node
from hil_sim.sensors.suite import FEET, TRUNK

Value = float | str


class FaultRefused(SimulatorError):
    """A fault cannot be made as it was asked for; the message names what is wrong and what is allowed."""


class FaultTarget(Enum):
    """Target of a fault: the devices on which it is possible."""

    DRIVE = tuple(JOINTS)
    NODE = (*JOINTS, CONTROLLER)
    SENSOR = SENSORS
    INSOLE = FEET
    IMU = (TRUNK,)
    FEET = ("insoles",)  # both at once
    WEARER = ("wearer",)
    BUS = ("bus",)
    HOST = ("host",)


class Form(Enum):
    """Form of a parameter's value."""

    REAL = "g"
    WHOLE = ".0f"
    CODE = "X"  # of a standard, in hexadecimal


@dataclass(frozen=True, slots=True)
class Number:
    """A parameter; `low` and `high` are themselves allowed."""

    default: float
    low: float
    high: float
    unit: str
    what: str
    form: Form = Form.REAL

    def check(self, name: str, value: object) -> float:
        """Return the value as a number; raises `FaultRefused`."""
        number = _number(value)
        whole = self.form is Form.REAL or (number is not None and number == int(number))
        if number is None or not whole or not self.low <= number <= self.high:
            raise FaultRefused(
                f"{name} = {value!r} is not possible ({self.what}): give a "
                f"{'' if self.form is Form.REAL else 'whole '}number from {self.show(self.low)} "
                f"to {self.show(self.high)}"
            )
        return number

    @property
    def facts(self) -> dict[str, Value]:
        """Facts that a program needs to set it."""
        bounds: dict[str, Value] = {"default": self.default, "min": self.low, "max": self.high}
        return bounds | {"unit": self.unit, "what": self.what}

    def show(self, value: Value) -> str:
        """Return a value as people write it, with its unit."""
        number = f"0x{int(value):X}" if self.form is Form.CODE else f"{value:g}"
        return f"{number} {self.unit}".rstrip()


@dataclass(frozen=True, slots=True)
class FolderName:
    """A parameter that names a folder; empty is the simulator's own."""

    what: str
    default: str = ""

    def check(self, name: str, value: object) -> str:
        """Return the folder's name; raises `FaultRefused`."""
        if not isinstance(value, str) or (value and not os.access(Path(value) / ".", os.W_OK)):
            raise FaultRefused(f"{name} = {value!r} is no folder to write in ({self.what}): name another one")
        return value

    @property
    def facts(self) -> dict[str, Value]:
        """Facts that a program needs to set it."""
        return {"default": self.default, "what": self.what}

    def show(self, value: Value) -> str:
        """Return a value as people write it."""
        return str(value) or "the simulator's"


Parameter = Number | FolderName


@dataclass(frozen=True, slots=True)
class Site:
    """Context of one fault: device, values, and its own random numbers."""

    robot: Exoskeleton
    device: str
    values: Mapping[str, Value]
    random: random.Random
    home: Path

    def number(self, name: str) -> float:
        return float(self.values[name])

    def whole(self, name: str) -> int:
        return int(self.values[name])

    def folder(self, name: str) -> Path:
        """Return the folder that a parameter names; the simulator's own where it names none."""
        return Path(str(self.values[name])) if self.values[name] else self.home

    @property
    def node(self) -> Node:
        """The CANopen device that the fault is on."""
        return self.robot.controller if self.device == CONTROLLER else self.drive

    @property
    def drive(self) -> JointDrive:
        return self.robot.drives[self.device]


@dataclass(frozen=True, slots=True)
class Fault:
    """A kind of fault.

    `act` is a context: what it does before its `yield` is the beginning, what it does behind that is the end.
    `looks` says in a sentence what a program on the bus, on the port or on the computer sees. A `momentary`
    fault is over as soon as it has begun and takes no duration.
    """

    on: FaultTarget
    act: Callable[[Site], AbstractContextManager[None]]
    looks: str
    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    momentary: bool = False

    @property
    def facts(self) -> dict[str, object]:
        """Facts that a program needs to inject it."""
        params = {key: parameter.facts for key, parameter in self.parameters.items()}
        return {"on": self.on.value, "looks": self.looks, "momentary": self.momentary, "params": params}


def _number(value: object) -> float | None:
    """Return a finite number, also from text as people type it (`5`, `0.2`, `0x2310`)."""
    if isinstance(value, str):
        try:
            value = int(value, 16) if value[:2].lower() == "0x" else float(value)
        except ValueError:
            return None
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return None
    return value
