"""How the robot's file names an object of a CANopen device: "0x6072:0", index and subindex."""

from typing import Annotated

from msgspec import Meta

ObjectName = Annotated[str, Meta(pattern=r"^0x[0-9A-Fa-f]{4}:(0x[0-9A-Fa-f]{1,2}|[0-9]{1,3})$")]


def address_of(name: str) -> tuple[int, int]:
    """Index and subindex, which may be more than a subindex can be."""
    index, _, subindex = name.partition(":")
    return int(index, 16), int(subindex, 16 if subindex.startswith("0x") else 10)
