"""Parameters: described, read, written, on trial, kept by their device."""

from typing import Annotated

from msgspec import UNSET, Meta, Struct, UnsetType

from gateway.wire.method import Globs, Method, Number, Params, Seconds
from gateway.wire.role import Role


class ParameterInfo(Struct, frozen=True):
    """One parameter of `robot.describe`; `states` are the drive states it may be written in, `None` any.

    The device's number is the value divided by `scale`, as the CiA 301 data type `type`. `read_only` says in
    a word why it cannot be written; a write is refused in full words.
    """

    name: str
    unit: str
    min: Number | None
    max: Number | None
    max_step: float | None
    live: bool
    states: list[str] | None
    component: str
    object: str
    access: str
    store: bool
    problem: str | None = None
    read_only: str | None = None
    type: str = ""
    scale: float = 1.0
    default: Number | None = None  # where the EDS gives one


class TrialInfo(Struct, frozen=True):
    """A write that is on trial, or still to be taken back."""

    write: int
    who: str
    values: dict[str, Number]  # what was written
    before: dict[str, Number]  # what it reverts to
    left_s: float | None  # until it reverts by itself; None: it is being taken back
    problem: str | None = None  # why it could not be taken back yet


class ParameterParams(Params, frozen=True):
    """`parameter.list` and `parameter.read`: names, addresses such as `left_knee.0x6072:0`, and globs.

    No names means every parameter but those that are `read_only`. Objects that are no parameters are for
    `object.read`.
    """

    names: Globs | None = None


class ParameterValue(Struct, frozen=True):
    """One parameter's value; `None` with the reason in `problem` where it is not known.

    What is no number has a `text` instead: a string as it stands, other bytes in hexadecimal.
    """

    value: Number | None
    unit: str
    min: Number | None
    max: Number | None
    stamp_ns: int | None
    problem: str | None = None
    text: str | UnsetType = UNSET


class ParameterValues(Struct, frozen=True):
    """Result of `parameter.list` and `parameter.read`."""

    values: dict[str, ParameterValue]


class ParameterWriteParams(Params, frozen=True):
    """`parameter.write`: values in the parameter's own unit."""

    changes: Annotated[dict[str, Number], Meta(min_length=1)]
    trial_s: Seconds | None = None


class Written(Struct, frozen=True):
    """Result of `parameter.write`: values as the device holds them.

    On trial, `trial_s` is the time until it reverts by itself, and `before` is what it reverts to, which may
    name more parameters than were asked for: those of the trials that this one replaces.
    """

    write: int
    before: dict[str, Number]
    after: dict[str, Number]
    trial_s: float | None = None


class WriteNumberParams(Params, frozen=True):
    """`parameter.confirm` and `parameter.revert`: the number that the trial's write was answered with."""

    write: int


class Confirmed(Struct, frozen=True):
    """Result of `parameter.confirm`: what stays written."""

    write: int
    values: dict[str, Number]


class Reverted(Struct, frozen=True):
    """Result of `parameter.revert`: in words, what became of each parameter."""

    write: int
    outcome: dict[str, str]


class ComponentParams(Params, frozen=True):
    """`parameter.store` and `parameter.restore`."""

    component: str


class Stored(Struct, frozen=True):
    """Result of `parameter.store` and `parameter.restore`: in words, what the device has done."""

    component: str
    result: str


_CONTROL = "control"
PARAMETER_LIST = Method("parameter.list", ParameterParams, ParameterValues, _CONTROL, role=Role.VIEWER)
PARAMETER_READ = Method(
    "parameter.read", ParameterParams, ParameterValues, _CONTROL, in_turn=True, role=Role.VIEWER
)
PARAMETER_WRITE = Method(
    "parameter.write", ParameterWriteParams, Written, _CONTROL, needs_lease=True, role=Role.OPERATOR
)
PARAMETER_CONFIRM = Method(
    "parameter.confirm", WriteNumberParams, Confirmed, _CONTROL, needs_lease=True, role=Role.OPERATOR
)
PARAMETER_REVERT = Method(
    "parameter.revert", WriteNumberParams, Reverted, _CONTROL, needs_lease=True, role=Role.OPERATOR
)
PARAMETER_STORE = Method(
    "parameter.store", ComponentParams, Stored, _CONTROL, needs_lease=True, role=Role.MAINTAINER
)
PARAMETER_RESTORE = Method(
    "parameter.restore", ComponentParams, Stored, _CONTROL, needs_lease=True, role=Role.MAINTAINER
)
METHODS = (
    PARAMETER_LIST,
    PARAMETER_READ,
    PARAMETER_WRITE,
    PARAMETER_CONFIRM,
    PARAMETER_REVERT,
    PARAMETER_STORE,
    PARAMETER_RESTORE,
)
