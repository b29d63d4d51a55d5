"""What tables and sentences call a command is one, with these options; what a table types works."""

import re
import shlex
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Final

import pytest

from gateway.main import COMMANDS
from tests.newcomer.newcomer import Newcomer
from tests.newcomer.pages import Command, Page, pages, prose
from tools.draw.commands import ALONE, WORDS, parser_of

TYPED_IN: Final = "how"  # the head of a column of what is typed
STAND_INS: Final = {"--seconds 60": "--seconds 1", "--requests 1000": "--requests 50"}
BY_HAND: Final = ("gwrms blame",)  # a bench's robot has no control loop on this computer
_SPAN: Final = re.compile(r"`(?:time )?(gwrms [^`]+)`")
_OPTION: Final = re.compile(r"(--[a-z][a-z-]*)")
_ROW: Final = re.compile(r"^\|(.+)\|$", re.MULTILINE)


def tables(page: Page) -> Iterator[list[list[str]]]:
    """The cells of each, its head first."""
    for part in prose(page).split("\n\n"):
        if rows := [[cell.strip() for cell in re.split(r"(?<!\\)\|", row)] for row in _ROW.findall(part)]:
            yield rows


def commands_of(text: str) -> list[str]:
    return _SPAN.findall(text)


@cache
def known(words: tuple[str, ...]) -> frozenset[str]:
    """The options of a command."""
    return frozenset(_OPTION.findall(parser_of(words).format_help()))


def command(words: list[str]) -> tuple[str, ...]:
    """The command that these words begin with."""
    name = words[0]
    assert name in COMMANDS, f"gwrms {name}: there is no such command"
    if words[1:2] and words[1] in WORDS.get(name, ()):
        return name, words[1]
    return () if name in WORDS and name not in ALONE else (name,)


def options(text: str) -> frozenset[str]:
    return frozenset(_OPTION.findall(text))


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_a_command_that_is_named_is_one_with_these_options(page: Page) -> None:
    for one in commands_of(prose(page)):
        words = one.split()[1:]
        if words[0].startswith("--") or words[0].isupper():
            continue  # of gwrms itself; any command
        chosen = command(words)
        assert options(one) <= (known(chosen) if chosen else {"--help"}), one


def test_a_table_of_a_command_has_its_options() -> None:
    found = 0
    for page in pages():
        for head, *rows in tables(page):
            named = commands_of(head[0])
            for row in rows if named else ():
                assert options(row[0]) <= known(command(named[0].split()[1:])), row
                found += len(options(row[0]))
    assert found >= 6


def test_what_tables_type_works(programs: Path) -> None:
    typed = [one for page in pages() for table in tables(page) for one in _typed(table)]
    assert len(typed) >= 4
    with Newcomer(programs, STAND_INS) as newcomer:
        newcomer.start(Command("gwrms sim --dir ~/robot", ('{"ready": true, …',)))
        newcomer.start(Command("gwrms gateway ~/robot/robot.toml", ("listening on …",)))
        for one in typed:
            here = newcomer.here(one)
            newcomer.run(Command(f"{here} --count 3" if shlex.split(here)[1] == "watch" else here, ("…",)))
        newcomer.end()


def _typed(table: list[list[str]]) -> Iterator[str]:
    head, *rows = table
    if TYPED_IN in head:
        for row in rows:
            found = commands_of(row[head.index(TYPED_IN)])
            yield from (one for one in found if not one.startswith(BY_HAND))
