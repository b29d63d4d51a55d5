"""The context in which components are built: what they share, and what they report."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drivers.line import Line, Recognise, unrecognised

if TYPE_CHECKING:
    import eds
    from drivers.bus.bus import CanBus
    from drivers.bus.channels import Chosen
    from drivers.reader_stalls import ReaderStalls


@dataclass(frozen=True, slots=True)
class BuildContext:
    """One robot's."""

    file: Path  # the robot's; other files are looked for beside it
    buses: "Mapping[str, CanBus]" = field(default_factory=dict)
    lines: dict[str, Line[Any]] = field(default_factory=dict)  # by the ports' paths
    descriptions: "dict[str, eds.Description]" = field(default_factory=dict)  # of CANopen devices, by name
    channels: "Mapping[str, Chosen]" = field(default_factory=dict)  # that the robot's file adds to them
    recognise: Recognise = unrecognised  # what speaks on a line instead of the format that is expected

    @property
    def standstill(self) -> "ReaderStalls | None":
        """The stalls of a bus's reader, for serial ports too; `None` without a bus."""
        return next((bus.standstill for bus in self.buses.values()), None)

    @property
    def folder(self) -> Path:
        return self.file.parent
