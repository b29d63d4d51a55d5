"""The object dictionaries of one robot's devices: listed once a link where somebody looks, and read."""

import time
from dataclasses import dataclass, field
from typing import Final

from gateway.client import ClientError, RemoteError
from gateway.wire.dictionary import ObjectInfo, ObjectList
from server_gui.core.objects.forms import place
from server_gui.core.objects.reading import Reading
from server_gui.core.threads.answers import Deliver, when_done
from server_gui.core.tuning.commands import Commands

AGAIN_S: Final = 5.0  # before what was not answered is asked for again
METHOD_NOT_FOUND: Final = -32601  # JSON-RPC 2.0 §5.1: a gateway of before
TOO_OLD: Final = "The robot's gateway is of an older version and does not tell its objects: update it."
NO_EDS: Final = (
    'What objects a device has stands in its EDS: name it as eds = "FILE" in the device\'s table of '
    "robot.toml, look at it with gwrms eds FILE, and start the gateway again."
)
NOTHING: Final = f"The EDS of this device has no object. {NO_EDS}"
LAST: Final = 0xFFFF


@dataclass(slots=True, eq=False)
class Dictionary:
    """Objects of one device by its EDS; `problem` is the reason if they are unknown."""

    objects: list[ObjectInfo] = field(default_factory=list)
    problem: str | None = None
    is_whole: bool = False
    revision: int = 0
    is_asked: bool = False
    tried_ns: int | None = None
    addresses: frozenset[str] = frozenset()
    still: frozenset[str] = frozenset()  # addresses of what is never read

    def take(self, objects: list[ObjectInfo]) -> None:
        """Take the complete list."""
        self.objects, self.is_whole, self.is_asked = objects, True, False
        self.addresses = frozenset(one.object for one in objects)
        self.still = frozenset(one.object for one in objects if one.access == "wo" or one.type == "DOMAIN")
        self.problem = None if objects else NOTHING
        self.revision += 1


class Objects:
    """For the window's thread; it costs nothing until somebody looks."""

    def __init__(self, commands: Commands, deliver: Deliver) -> None:
        self._commands = commands
        self._deliver = deliver
        self._by_component: dict[str, Dictionary] = {}
        self.reading = Reading(commands, deliver)

    def of(self, component: str, *, ask: bool = True) -> Dictionary:
        """Return a device's dictionary; on this link's first use, read it."""
        found = self._by_component.setdefault(component, Dictionary())
        now_ns = time.monotonic_ns()
        is_due = found.tried_ns is None or now_ns - found.tried_ns >= AGAIN_S * 1e9
        if ask and not found.is_whole and not found.is_asked and is_due:
            found.tried_ns = now_ns
            self._ask(component, found, [], 0)
        return found

    def described(self, *, is_another: bool) -> None:
        """Take the robot's description: files may differ, and after a boot values too."""
        if is_another:
            self._by_component.clear()
        for known in self._by_component.values():  # shown until it is known anew
            known.is_whole, known.tried_ns = False, None
        self.reading.forget(values=is_another)

    def _ask(self, component: str, asked: Dictionary, known: list[ObjectInfo], first: int) -> None:
        """Ask for those from an index on: a gateway tells some hundreds at a time."""
        asked.is_asked = True
        when_done(
            self._commands.objects(component, f"0x{first:04X}…"),
            self._deliver,
            lambda told: self._told(component, asked, known, told, first),
            lambda error: self._failed(asked, error),
        )

    def _told(
        self, component: str, asked: Dictionary, known: list[ObjectInfo], told: ObjectList, first: int
    ) -> None:
        have = {info.object for info in known}
        known += [info for info in told.objects if info.object not in have]
        try:
            following = _following([place(info.object)[0] for info in told.objects], first)
        except ValueError as error:
            self._failed(asked, error)
            return
        if told.left_off and following is not None:
            self._ask(component, asked, known, following)
        else:
            asked.take(known)

    def _failed(self, asked: Dictionary, error: Exception) -> None:
        asked.is_asked = False
        asked.problem = _in_words(error)
        asked.revision += 1


def _following(indices: list[int], first: int) -> int | None:
    """Return where to go on: at the last index, which may have more, unless it filled an answer alone."""
    if not indices:
        return None
    last = indices[-1]
    following = last + 1 if last == first or indices[0] == last else last
    return following if first < following <= LAST else None


def _in_words(error: Exception) -> str:
    if isinstance(error, RemoteError):
        return TOO_OLD if error.code == METHOD_NOT_FOUND else f"{str(error).rstrip('.')}. {NO_EDS}"
    if isinstance(error, ClientError):
        return f"Its objects could not be asked for: {error}"
    return f"The robot has told what is no list of objects: {error}"
