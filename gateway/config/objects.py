"""Objects of CANopen devices in the robot's file: how they are named, and those that are no parameters."""

from typing import Annotated

from msgspec import Meta

# As "0x6072:0", index and subindex.
ObjectName = Annotated[
    str,
    Meta(
        pattern=r"^0x[0-9A-Fa-f]{4}:(0x[0-9A-Fa-f]{1,2}|[0-9]{1,3})$",
        title="index and sub-index",
        examples=["0x6072:0"],
    ),
]

CONTROLWORD = 0x6040
AXIS_OFFSET = 0x800  # between the objects of a multi-axis drive's axes (CiA 402-2)
STORE, RESTORE = 0x1010, 0x1011


def address_of(name: str) -> tuple[int, int]:
    """Index and subindex, which may be more than a subindex can be."""
    index, _, subindex = name.partition(":")
    return int(index, 16), int(subindex, 16 if subindex.startswith("0x") else 10)
