"""Definition of a mistake: in lines of robot.toml, in the robot itself, or in files of its computer."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Exoskeleton


@dataclass(frozen=True, slots=True)
class FileKey:
    """A key of a table of robot.toml, as TOML; `{folder}` in it is the simulator's."""

    table: str
    key: str
    value: str


@dataclass(frozen=True, slots=True)
class Mistake:
    """`what` says in words what is wrong; `act` makes it before the robot is switched on.

    `computer` are files of /sys, /proc and /run with their contents; None: the file is not there.
    """

    what: str
    lines: Sequence[FileKey] = ()
    act: Callable[[Exoskeleton], None] | None = None
    computer: Mapping[str, str | None] = field(default_factory=dict)


def written(text: str, lines: Sequence[FileKey], folder: str) -> str:
    """Return the file with these lines; raises `SimulatorError` where a table is missing."""
    for line in lines:
        text = _with_line(text, line, line.value.replace("{folder}", folder))
    return text


def _with_line(text: str, line: FileKey, value: str) -> str:
    head = re.search(rf"^\[{re.escape(line.table)}\].*\n", text, re.MULTILINE)
    if head is None:
        raise SimulatorError(f"this robot has no [{line.table}], so that mistake cannot be made")
    following = re.search(r"^\[", text[head.end() :], re.MULTILINE)
    end = len(text) if following is None else head.end() + following.start()
    body, new = text[head.end() : end], f"{line.key} = {value}"
    changed, count = re.subn(rf"^{line.key} = .*$", lambda _: new, body, count=1, flags=re.MULTILINE)
    return text[: head.end()] + (changed if count else f"{new}\n{body}") + text[end:]
