"""The object dictionary of a device: what its EDS says, and what the device holds; nothing here writes."""

from typing import Annotated

from msgspec import Meta, Struct

from gateway.wire.limits import OBJECTS_READ
from gateway.wire.method import Method, Number, Params
from gateway.wire.role import Role

Object = Annotated[str, Meta(pattern=r"^0x[0-9A-Fa-f]{4}:[0-9]{1,3}$")]  # 0x6041:0


class ObjectListParams(Params, frozen=True):
    """`object.list`: of a component; `search` is an address, a range of them, or words of the name.

    `0x6041`, `0x1018:4`, `0x60*`, `0x6060-0x607F`, `0x6060…` (from there on), `target position`.
    """

    component: str
    search: Annotated[str, Meta(max_length=200)] = ""


class ObjectInfo(Struct, frozen=True):
    """One object of a device, as its EDS has it.

    `parameter` is its name where it is one; `read_only` says why it cannot be written, in a word, `locked`
    in full, and `release` has the lines of the robot's file that would let it be written. `unit` is that of
    the device's number, where the EDS names one; `pdos` are those that it is mapped in, by the EDS.
    """

    object: str
    name: str
    type: str
    access: str
    min: Number | None
    max: Number | None
    default: Number | str | None
    parameter: str | None
    read_only: str | None
    unit: str = ""
    pdos: list[str] = []
    locked: str | None = None
    release: str | None = None


class ObjectList(Struct, frozen=True):
    """Result of `object.list`: by address, and how many more there would be."""

    component: str
    objects: list[ObjectInfo]
    left_off: int = 0


class ObjectReadParams(Params, frozen=True):
    """`object.read`: these objects of a component, at most 64."""

    component: str
    objects: Annotated[list[Object], Meta(min_length=1, max_length=OBJECTS_READ)]


class ObjectValue(Struct, frozen=True):
    """A device's value: a number in its own counts, a text, or bytes in hexadecimal.

    `words` is the same for people; `problem` says why nothing is known.
    """

    value: Number | str | None
    words: str
    stamp_ns: int | None
    problem: str | None = None


class ObjectValues(Struct, frozen=True):
    """Result of `object.read`, by address."""

    component: str
    values: dict[str, ObjectValue]


OBJECT_LIST = Method("object.list", ObjectListParams, ObjectList, "control", role=Role.VIEWER)
OBJECT_READ = Method("object.read", ObjectReadParams, ObjectValues, "control", in_turn=True, role=Role.VIEWER)
METHODS = (OBJECT_LIST, OBJECT_READ)
