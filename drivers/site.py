"""Where components are built: what they find there, what they share, and what they tell of themselves."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import eds
    from drivers.bus.bus import CanBus
    from drivers.line import Line


@dataclass(frozen=True, slots=True)
class Site:
    """One robot's."""

    file: Path  # the robot's; other files are looked for beside it
    buses: "Mapping[str, CanBus]" = field(default_factory=dict)
    lines: "dict[str, Line[Any]]" = field(default_factory=dict)  # by the ports' paths
    descriptions: "dict[str, eds.Description]" = field(default_factory=dict)  # of CANopen devices, by name

    @property
    def folder(self) -> Path:
        return self.file.parent
