"""docs/reference/commands.md: every command, from the parsers that read their arguments."""

import argparse
import contextlib
import getpass
import io
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final
from unittest import mock

from gateway import main

PAGE: Final = "commands.md"
# Commands whose first word chooses a further one; a bench's and a sensor's own parser has none of these.
WORDS: Final[Mapping[str, tuple[str, ...]]] = {
    "params": ("save", "compare", "apply"),
    "journal": ("tail", "verify"),
    "keys": ("pair", "list", "push", "add", "revoke"),
    "sensor": ("record", "replay", "decode"),
    "calibrate": ("insole", "imu", "joint"),
    "sessions": ("ls", "show", "gait", "resources", "compare", "changed", "export"),
    "cloud": (
        "ls",
        "du",
        "verify",
        "mend",
        "upload",
        "download",
        "compact",
        "retain",
        "vacuum",
        "forget",
        "witnesses",
    ),
    "models": ("ls", "show", "promote", "rollback", "history", "export"),
    "edits": ("show",),
    "joint-test": ("step", "chirp", "friction", "relay", "stop", "show"),
    "sim": ("run",),
}
ALONE: Final = frozenset({"edits", "sensor", "sim"})  # which are commands without such a word too
_HEAD: Final = """# Commands

`gwrms COMMAND --help` shows the same text. Commands that query a robot take `--robot HOST:PORT`
(127.0.0.1:7420) and `--json`; those that query the store take `--config` and `--json`. Exit status: 0 done,
1 failed, 2 wrong usage, unless a command says more. Errors are a sentence or two on stderr; `--debug`
anywhere shows tracebacks.
"""


class _Captured(Exception):
    """The parser was reached: nothing of the command runs."""

    def __init__(self, parser: argparse.ArgumentParser) -> None:
        super().__init__(parser.prog)
        self.parser = parser


@dataclass(frozen=True, slots=True)
class Command:
    """One command with its parser."""

    words: tuple[str, ...]
    parser: argparse.ArgumentParser


def draw() -> str:
    """Return the page."""
    found = list(commands())
    overview = ["| command | |", "|---|---|"]
    overview += [
        f"| [`gwrms {name}`](#{_anchor((name,))}) | {what} |" for name, (_, what) in main.COMMANDS.items()
    ]
    return "\n".join([_HEAD, *overview, "", *(line for one in found for line in _section(one))])


def commands() -> Iterator[Command]:
    """Yield every command that has arguments of its own, in the order of `gwrms --help`."""
    for name in main.COMMANDS:
        words = WORDS.get(name, ())
        if not words or name in ALONE:
            yield Command((name,), parser_of((name,)))
        for word in words:
            yield Command((name, word), parser_of((name, word)))


def parser_of(words: tuple[str, ...]) -> argparse.ArgumentParser:
    """Return the parser of a command's arguments; found by running it up to there."""

    def capture(parser: argparse.ArgumentParser, *_arguments: object, **_named: object) -> None:
        raise _Captured(parser)

    name, *rest = words
    with contextlib.ExitStack() as stack:
        for method in ("parse_args", "parse_intermixed_args", "parse_known_args"):
            stack.enter_context(mock.patch.object(argparse.ArgumentParser, method, capture))
        stack.enter_context(mock.patch.object(getpass, "getuser", return_value="your account"))
        stack.enter_context(contextlib.redirect_stdout(io.StringIO()))
        try:
            main.find(name)([*rest, "--help"])
        except _Captured as captured:
            return captured.parser
    raise LookupError(f"gwrms {' '.join(words)} has no parser")


def _anchor(words: tuple[str, ...]) -> str:
    first = words[0]
    chosen = (first, WORDS[first][0]) if first in WORDS and first not in ALONE else words
    return "gwrms-" + "-".join(chosen)


def _section(command: Command) -> Iterator[str]:
    parser = command.parser
    yield f"## `gwrms {' '.join(command.words)}`"
    yield ""
    yield from [_sentence(parser.description or ""), ""] if parser.description else []
    yield from ["| argument | |", "|---|---|"]
    yield from (_argument(action, parser) for action in _actions(parser))
    yield ""
    if parser.epilog:
        yield from ["```text", parser.epilog.strip("\n"), "```", ""]


def _actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    known = parser._actions  # noqa: SLF001 - argparse tells them nowhere else
    return [action for action in known if action.option_strings[:1] != ["-h"]]


def _argument(action: argparse.Action, parser: argparse.ArgumentParser) -> str:
    said = (action.help or "") % (vars(action) | {"prog": parser.prog})
    told = ", ".join(f"`{name}`" for name in _names(action))
    return f"| {told} | {_cell(said)} |"


def _names(action: argparse.Action) -> Iterator[str]:
    value = _value(action)
    if not action.option_strings:
        yield value
    for name in action.option_strings:
        yield f"{name} {value}".strip()


def _value(action: argparse.Action) -> str:
    if action.nargs == 0:
        return ""
    chosen = "{" + ",".join(map(str, action.choices)) + "}" if action.choices else action.dest.upper()
    one = action.metavar or (chosen if action.option_strings or action.choices else action.dest.upper())
    name = " ".join(one) if isinstance(one, tuple) else one
    many = {"*": f"[{name} …]", "+": f"{name} [{name} …]", "?": f"[{name}]"}
    return many.get(str(action.nargs), name)


def _sentence(text: str) -> str:
    return " ".join(text.split())


def _cell(text: str) -> str:
    return re.sub(r"([|<*_])", r"\\\1", " ".join(text.split()))
