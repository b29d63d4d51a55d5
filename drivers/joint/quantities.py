"""Quantities of a joint: CiA 402 objects, their units, and the channels made of them."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

from drivers.joint.cia402 import MODES, STATE_WORDS
from drivers.samples import Channel
from eds import Description
from eds.datatypes import DATA_TYPES
from eds.profile import profile_of

AXIS_OFFSET = 0x800  # between the objects of two axes in one node (CiA 402-2 §5)


@dataclass(frozen=True, slots=True)
class Quantity:
    """One object that becomes one channel; `scale` is fixed where it is not the joint's own."""

    name: str
    index: int
    subindex: int
    unit: str
    kind: str  # "signed", "unsigned" or "real"
    scale: float | None = None
    enum: dict[int, str] | None = None
    fast: bool = False  # a joint is not known without it
    bits: int | None = None  # of its type; None: the EDS gives it none that is a number


STATE = "state"  # the channel that is made of the statusword
POSITION, STATUSWORD = "position", "statusword"

_STANDARD = (
    Quantity(POSITION, 0x6064, 0, "rad", kind="signed", fast=True),
    Quantity("velocity", 0x606C, 0, "rad/s", kind="signed"),
    Quantity("torque", 0x6077, 0, "N·m", kind="signed"),
    Quantity("current", 0x6078, 0, "A", kind="signed"),
    Quantity("following_error", 0x60F4, 0, "rad", kind="signed"),
    Quantity(STATUSWORD, 0x6041, 0, "", kind="unsigned", scale=1, fast=True),
    Quantity("modes_display", 0x6061, 0, "", kind="signed", scale=1, enum=MODES),
    Quantity("error_code", 0x603F, 0, "", kind="unsigned", scale=1),
)

# Bits 0 to 3: negative and positive limit switch, home switch, interlock; from 16 on the maker's own. The
# voltage is that of the DC link, in mV (CiA 402-2).
_SURROUNDINGS = (
    Quantity("digital_inputs", 0x60FD, 0, "", kind="unsigned", scale=1),
    Quantity("voltage", 0x6079, 0, "V", kind="unsigned", scale=0.001),
)

# Those of every joint, which the robot's file cannot give another object.
OWN = frozenset({STATE, *(one.name for one in _STANDARD)})

REQUIRED = ((0x6041, "statusword"), (0x6064, "position actual value"))


def quantities(description: Description, axis: int) -> tuple[Quantity, ...]:
    """Return the quantities that this drive offers; raises `EdsError` if it cannot be a joint."""
    offset = axis * AXIS_OFFSET
    description.require(
        [(index + offset, name) for index, name in REQUIRED], "a joint" if axis == 0 else f"axis {axis}"
    )
    shifted = (_shift(quantity, offset) for quantity in (*_STANDARD, *_makers(description), *_SURROUNDINGS))
    found = {one.name: _as_described(one, description) for one in shifted if _described(one, description)}
    return tuple(found.values())


def channels(component: str, found: tuple[Quantity, ...]) -> tuple[Channel, ...]:
    """Return the channels of a joint: one a quantity, in their order, and its state last."""
    return (
        *(Channel(f"{component}.{q.name}", component, q.name, q.unit, q.enum) for q in found),
        Channel(f"{component}.{STATE}", component, STATE, "", STATE_WORDS),
    )


def _makers(description: Description) -> Iterator[Quantity]:
    """Yield quantities without a standard object, from the product's profile."""
    profile = profile_of(description)
    if profile is None:
        return
    for name, one in profile.found(description)[0].items():
        yield Quantity(name, one.index, one.subindex, one.unit, kind="signed", scale=one.scale)


def _shift(quantity: Quantity, offset: int) -> Quantity:
    in_profile = quantity.index >= 0x6000
    return replace(quantity, index=quantity.index + offset) if in_profile else quantity


def _described(quantity: Quantity, description: Description) -> bool:
    return description.has(quantity.index, quantity.subindex)


def _as_described(quantity: Quantity, description: Description) -> Quantity:
    """Return the number as the device's own data type has it."""
    variable = description.variable(quantity.index, quantity.subindex)
    data_type = None if variable is None else DATA_TYPES.get(variable.data_type or 0)
    kinds = ("signed", "unsigned") if quantity.name == STATUSWORD else ("signed", "unsigned", "real")
    if data_type is None or data_type.kind not in kinds:
        return quantity
    return replace(quantity, kind=data_type.kind, bits=data_type.bits)
