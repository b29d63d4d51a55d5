"""A request to commission a robot: its file, its bus, and the computer they are on."""

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

SUFFIX: Final = ".commission"  # of what is kept beside the file until that is written


@dataclass(frozen=True, slots=True)
class CommissioningRequest:
    """Arguments of `gwrms commission`. Without `computer` it runs on this one, else there, by SSH."""

    file: str
    bus: str
    bitrate: str = ""
    eds: Sequence[str] = ()
    serial: Sequence[str] = ()
    who: str = ""
    computer: str = ""

    @property
    def problem(self) -> str:
        """The missing part, in words; "" if it can begin."""
        if not self.file.strip():
            return "name the robot's file that is to be written, as exo-01.toml"
        if not self.file.endswith(".toml"):
            return f"{self.file}: a robot's file ends with .toml"
        if not self.bus.strip():
            return "name its CAN bus, as can0"
        if self.bitrate and not self.bitrate.isdecimal():
            return f"{self.bitrate}: the bit rate is a number of bit/s, as 1000000"
        if self.computer.startswith("-") or len(self.computer.split()) > 1:
            return f"{self.computer}: a computer is named as ssh does it, as user@exo-01"
        return ""

    @property
    def place(self) -> str:
        """The robot's file and computer, which tell it from every other: `user@exo-01:exo-01.toml`."""
        return f"{self.computer}:{self.file}" if self.computer else self.file

    @property
    def left(self) -> Path | None:
        """The draft of an earlier dialogue, on this computer."""
        kept = Path(self.file + SUFFIX)
        return kept if not self.computer and self.file and kept.is_file() else None

    @property
    def typed(self) -> str:
        """The same as somebody would type it."""
        return shlex.join(["gwrms", *self.arguments("--json")]).replace(" --json", "").replace(" -- ", " ")

    def arguments(self, *more: str) -> list[str]:
        """Return the arguments of `gwrms`."""
        options = {
            "--bitrate": [self.bitrate],
            "--eds": self.eds,
            "--serial": self.serial,
            "--who": [self.who],
        }
        told = [f"{name}={value}" for name, values in options.items() for value in values if value]
        return ["commission", *more, *told, "--", self.file, self.bus]

    @property
    def stopping(self) -> list[str]:
        """Arguments of `gwrms` for a quick stop of every drive found so far."""
        return self.arguments("--json", "--stop")
