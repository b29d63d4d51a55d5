"""Names of processes, from their commands: all interpreters have one name."""

import collections
import re
from collections.abc import Sequence
from typing import Final

from msgspec import UNSET

from gateway.plain_text import plain
from gateway.wire.resource import ProcessUse

MOST_LETTERS: Final = 28
_INTERPRETER: Final = re.compile(r"(python|pypy|perl)[\d.]*|(ba|da|k|z)?sh|node(js)?")


def command_of(process: ProcessUse) -> str:
    """Return the command line; the name where the robot does not tell it, as of a kernel's thread."""
    return process.name if process.cmdline is UNSET or not process.cmdline else process.cmdline


def arguments_of(process: ProcessUse) -> str:
    """Return the part that distinguishes processes of one name: the command without its interpreter.

    With it where what it runs has no name: `bash /dev/fd/3`.
    """
    words = command_of(process).split()
    runs = _without_interpreter(words)
    if not runs:
        return ""
    program = runs[0].rpartition("/")[2]
    if runs is not words and not any(map(str.isalpha, program)):
        return " ".join([words[0].rpartition("/")[2], *runs])
    return " ".join([program, *runs[1:]])


def short_name(process: ProcessUse) -> str:
    """Return it in few words: of an interpreter what it runs, `gwrms gateway`; else its own name."""
    if not _is_interpreter(process.name) and process.name != "gwrms":
        return plain(process.name)
    if process.cmdline is UNSET or not process.cmdline:
        return f"{plain(process.name)} {process.pid}"
    words = arguments_of(process).split()[:2]
    told = [word if _is_interpreter(words[0]) else word.rpartition("/")[2] for word in words]
    said = plain(" ".join(word for word in told if not word.startswith("-")) or process.name)
    return said if len(said) <= MOST_LETTERS else f"{said[: MOST_LETTERS - 1]}…"


def told_apart(named: Sequence[tuple[str, int]]) -> list[str]:
    """Return each name, with its process id where another has the same."""
    count = collections.Counter(name for name, _ in named)
    return [f"{name} {pid}" if count[name] > 1 else name for name, pid in named]


def labels(processes: Sequence[ProcessUse]) -> dict[int, str]:
    """Return what each process is called by its id, wherever it is shown, so that none has two names."""
    named = [(short_name(process), process.pid) for process in processes]
    return {pid: label for (_, pid), label in zip(named, told_apart(named), strict=True)}


def _without_interpreter(words: list[str]) -> list[str]:
    """Return the words of a command from the program that an interpreter runs; all where there is none."""
    if len(words) < 2 or not _is_interpreter(words[0]):
        return words
    rest = words[1:]
    while len(rest) > 1 and rest[0].startswith("-"):
        rest = rest[1:]
    return _without_interpreter(rest)


def _is_interpreter(word: str) -> bool:
    return _INTERPRETER.fullmatch(word.rpartition("/")[2]) is not None
