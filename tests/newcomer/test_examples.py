"""What every `--help` and page shows is taken by its command; examples for a robot do something at one."""

import re
import shlex
import shutil
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

import pytest

from tests.newcomer.newcomer import Newcomer
from tests.newcomer.pages import Command, Page, blocks, pages
from tests.newcomer.pages import commands as typed_in
from tools.draw.commands import commands, parser_of

ROOT: Final = Path(__file__).parents[2]
_LINE: Final = re.compile(
    r"^ +(gwrms (?:[^\s#]|(?<=\S) (?=\S))+)"
)  # up to what is said of it, two blanks away
_BEYOND: Final = frozenset({"|", "||", ">", "&", "&&"})  # words that are the shell's, with all that follows
_PLACE: Final = re.compile(r"\b(FILE|DIR|HOST:PORT)\b|…")

REPLAY: Final = " --replay "  # with it, `gwrms sim` has another parser
ROBOT: Final = "~/robot"
# Typed at a simulated robot, in this order; the rest needs what no robot on a bench has.
AT_A_ROBOT: Final = (
    "check", "snapshot", "cost", "bench", "watch", "plot", "get", "set", "params save", "params compare",
    "params apply", "sim-fault", "eds",
)  # fmt: skip
BY_HAND: Final[Mapping[str, str]] = {
    "gwrms set --trial 30 gait.cycle_time=1.1": "two presses of Enter: typed by the tutorial's test",
    "gwrms params apply monday.toml --trial 60": "the same",
    "gwrms sim-fault --dir /tmp/robot --controller start": "a stop before it",
    "gwrms params apply left_knee.dcf --component right_knee --skip": "a terminal, on which it asks",
}
# What the examples name, and what is here in its place.
STAND_INS: Final[Mapping[str, str]] = {
    "192.0.2.7": "127.0.0.1",
    "/tmp/robot": ROBOT,
    "--seconds 10": "--seconds 1",
}
GOES_ON: Final = ("watch", "plot")
ENDS: Final = ("--count", "--seconds")  # … but with one of these


class Example(NamedTuple):
    """A line of a command's help."""

    command: str
    typed: str


def examples() -> Iterator[Example]:
    for one in commands():
        for line in (one.parser.epilog or "").splitlines():
            if found := _LINE.match(line):
                yield Example(" ".join(one.words), found[1])


@pytest.mark.parametrize("example", list(examples()), ids=lambda example: example.typed)
def test_an_example_is_taken_by_its_command(example: Example) -> None:
    if _PLACE.search(example.typed) or example.typed.count('"') % 2:
        pytest.skip("it has a place for something else, or goes on in the next line")
    _is_taken(example.typed)


@pytest.mark.parametrize("page", pages(), ids=lambda page: page.name)
def test_what_a_page_shows_is_taken_by_its_command(page: Page) -> None:
    """Also where it is typed by night only, or by hand."""
    for block in blocks(page):
        for command in typed_in(block) if block.is_shell else ():
            for line in command.typed.replace("\\\n", " ").splitlines():
                if line.startswith("gwrms ") and not line.startswith("gwrms -") and REPLAY not in line:
                    _is_taken(line)


def _is_taken(typed: str) -> None:
    words = shlex.split(typed, comments=True)[1:]
    words = words[: next((at for at, word in enumerate(words) if word in _BEYOND), len(words))]
    name = tuple(words[:2]) if f"{words[0]} {' '.join(words[1:2])}" in _known() else (words[0],)
    parser_of(name).parse_intermixed_args(words[len(name) :])


def test_examples_at_a_robot_do_something(programs: Path) -> None:
    with Newcomer(programs, STAND_INS) as newcomer:
        newcomer.start(Command(f"gwrms sim --dir {ROBOT}", ('{"ready": true, …',)))
        newcomer.start(Command("gwrms gateway robot/robot.toml", ("listening on …",)))
        _prepare(newcomer.home)
        for example in _at_a_robot():
            typed = newcomer.here(example.typed)
            if example.command in GOES_ON and not any(word in typed for word in ENDS):
                newcomer.start(Command(typed.replace(" > ", " | tee "), ()))  # until it shows something
                newcomer.close()
            else:
                newcomer.run(Command(typed, ()))
        newcomer.end()


def _at_a_robot() -> list[Example]:
    found = [each for each in examples() if each.command in AT_A_ROBOT and each.typed not in BY_HAND]
    return sorted(found, key=lambda example: AT_A_ROBOT.index(example.command))


def _prepare(home: Path) -> None:
    """What lies about where somebody works: a robot's file, and makers' files."""
    shutil.copy(home / "robot" / "robot.toml", home / "robot.toml")
    for name in ("my_drive.eds", "drive.eds"):
        shutil.copy(ROOT / "eds" / "files" / "joint_drive.eds", home / name)
    shutil.copy(ROOT / "eds" / "files" / "joint_drive.eds", home / "one.dcf")


@cache
def _known() -> frozenset[str]:
    return frozenset(" ".join(one.words) for one in commands())
