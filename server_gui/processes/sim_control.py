"""Control of our simulator (faults and start) by its socket, as `gwrms sim-fault` does."""

import os
import shlex
import socket
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import msgspec

NAME: Final = "control"
ANSWER_S: Final = 10.0
ALL: Final = "all"


class SimulatorRefuses(Exception):
    """The simulator does not answer, or refuses; the message says why."""


class FaultKind(msgspec.Struct, frozen=True):
    """A kind of fault: what it can be on, what it looks like, where it is on now."""

    on: tuple[str, ...]
    looks: str
    momentary: bool = False
    active: tuple[str, ...] = ()


class ActiveFault(msgspec.Struct, frozen=True):
    """A fault that is on."""

    name: str
    on: str


class Listed(msgspec.Struct, frozen=True):
    """Every fault by its name, and those that are on."""

    faults: dict[str, FaultKind]
    active: tuple[ActiveFault, ...]


def start_command(folder: Path) -> str:
    """Return the command by which a terminal starts the controller of the simulator in a folder."""
    return f"gwrms sim-fault --dir {shlex.quote(str(folder))} --controller start"


class SimControl:
    """Control of the simulator in `folder`; each call waits for its answer.

    Raises:
        SimulatorRefuses: by every call.

    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def listed(self) -> Listed:
        """Return the possible and the active faults."""
        try:
            return msgspec.convert(self._ask({"list": True}), Listed)
        except msgspec.ValidationError as error:
            raise SimulatorRefuses(f"the simulator is another version: {error}") from error

    def break_(self, fault: str, on: str) -> None:
        """Begin a fault on a device, until it is mended."""
        self._ask({"fault": fault, "on": on})

    def mend(self) -> None:
        """End every fault."""
        self._ask({"clear": ALL})

    def walk(self) -> None:
        """Let the wearer walk, and the gait controller start after whatever has made it wait."""
        self._ask({"activity": "walk"})
        self._ask({"controller": "start"})

    def _ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        try:
            answer = self._answer(msgspec.json.encode(request) + b"\n")
        except (OSError, msgspec.MsgspecError) as error:
            raise SimulatorRefuses(f"the simulator does not answer: {error}") from error
        if "error" in answer:
            raise SimulatorRefuses(str(answer["error"]))
        return answer

    def _answer(self, line: bytes) -> dict[str, Any]:
        folder = os.open(self._folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as asking:
                asking.settimeout(ANSWER_S)
                # However long the folder's name is, this fits into an address (107 bytes).
                asking.connect(f"/proc/self/fd/{folder}/{NAME}")
                asking.sendall(line)
                with asking.makefile("rb") as lines:
                    return msgspec.json.decode(lines.readline(), type=dict[str, Any])
        finally:
            os.close(folder)
