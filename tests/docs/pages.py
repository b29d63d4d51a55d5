"""What a page of the docs shows to be typed: its shell blocks, and the files that it shows whole."""

import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).parents[2] / "docs"
RUN_KINDS = ("tutorial", "how-to")  # every shell block of these is run
BY_HAND = "by-hand"  # needs hardware, a display, root, or a service that a test has not
TERMINAL = "terminal"  # goes on until the page ends, as in a terminal of its own

_FENCE = re.compile(r"^```(\S+)[ ]?([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_TITLE = re.compile(r'title="([^"]+)"')
SHELLS = frozenset({"sh", "console", "bash", "shell", "shell-session", "zsh"})


@dataclass(frozen=True, slots=True)
class Block:
    """A fenced block: its language, the words behind that, and its text."""

    language: str
    words: str
    text: str

    @property
    def by_hand(self) -> bool:
        return BY_HAND in self.words.split()

    @property
    def terminal(self) -> bool:
        return TERMINAL in self.words.split()

    @property
    def is_shell(self) -> bool:
        return self.language in SHELLS

    @property
    def file(self) -> str | None:
        """The name of the file that it shows."""
        found = _TITLE.search(self.words)
        return found and found[1]


@dataclass(frozen=True, slots=True)
class Command:
    """What is typed, and what the page shows of its output."""

    typed: str
    shown: tuple[str, ...] = ()


def blocks(page: Path) -> list[Block]:
    """Every fenced block, in the page's order."""
    return [Block(*found.groups()) for found in _FENCE.finditer(page.read_text(encoding="utf-8"))]


def commands(block: Block) -> list[Command]:
    """A `sh` block is one command; a `console` block has one behind each prompt."""
    if block.language != "console":
        return [Command(block.text)]
    typed: list[list[str]] = []
    shown: list[list[str]] = []
    for line in block.text.splitlines():
        if line.startswith("$ "):
            typed.append([line[2:]])
            shown.append([])
        elif not shown[-1] and typed[-1][-1].endswith("\\"):
            typed[-1].append(line)
        else:
            shown[-1].append(line)
    return [Command("\n".join(lines), tuple(output)) for lines, output in zip(typed, shown, strict=True)]


def pages() -> list[Path]:
    """Those of which every shell block is run."""
    return sorted(page for kind in RUN_KINDS for page in (DOCS / kind).glob("*.md"))


def name(page: Path) -> str:
    return page.relative_to(DOCS).as_posix()
