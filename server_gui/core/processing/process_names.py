"""Names of processes, from their commands: all interpreters have one name."""

from collections.abc import Sequence
from typing import Final

from msgspec import UNSET

from gateway.plain_text import plain
from gateway.wire.resource import ProcessUse

MOST_LETTERS: Final = 28


def command_of(process: ProcessUse) -> str:
    """Return the command line; the name where the robot does not tell it, as of a kernel's thread."""
    return process.name if process.cmdline is UNSET or not process.cmdline else process.cmdline


def arguments_of(process: ProcessUse) -> str:
    """Return the part that distinguishes processes of one name: the command without its interpreter."""
    words = command_of(process).split()
    while len(words) > 1 and (_is_interpreter(words[0]) or words[0].startswith("-")):
        words.pop(0)
    return " ".join([words[0].rpartition("/")[2], *words[1:]]) if words else ""


def short_name(process: ProcessUse) -> str:
    """Return it in few words: of an interpreter what it runs, `gwrms gateway`; else its own name."""
    if not _is_interpreter(process.name) and process.name != "gwrms":
        return plain(process.name)
    if process.cmdline is UNSET or not process.cmdline:
        return f"{plain(process.name)} {process.pid}"
    words = [word.rpartition("/")[2] for word in arguments_of(process).split()[:2]]
    said = plain(" ".join(word for word in words if not word.startswith("-")) or process.name)
    return said if len(said) <= MOST_LETTERS else f"{said[: MOST_LETTERS - 1]}…"


def told_apart(named: Sequence[tuple[str, int]]) -> list[str]:
    """Return each name, with its process id where another has the same."""
    names = [name for name, _ in named]
    return [f"{name} {pid}" if names.count(name) > 1 else name for name, pid in named]


def _is_interpreter(word: str) -> bool:
    return word.rpartition("/")[2].startswith(("python", "sh", "bash", "perl", "node"))
