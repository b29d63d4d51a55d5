"""What the docs show to be typed: their shell blocks and scripts, and the files that they show whole."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
DOCS: Final = ROOT / "docs"
README: Final = ROOT / "README.md"
RUN_KINDS: Final = ("tutorial", "how-to")  # every shell block of these is run, as are the README's
BY_HAND: Final = "by-hand"  # needs hardware, a display, root, or a service that a test has not
TERMINAL: Final = "terminal"  # goes on until the page ends, as in a terminal of its own
CLOSED: Final = "closed"  # … or only until it has shown something

_FENCE = re.compile(r"^```(\S+)[ ]?([^\n]*)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_LEAD = re.compile(r"^(?:#+ (.+)$|\*\*(.+?)\.\*\*)", re.MULTILINE)  # a heading, or a paragraph's first words
_TITLE = re.compile(r'title="([^"]+)"')
SHELLS = frozenset({"sh", "console", "bash", "shell", "shell-session", "zsh"})


@dataclass(frozen=True, slots=True)
class Page:
    """What is typed in one home: a page of the docs, or a section of the README."""

    name: str
    text: str


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
    def closed(self) -> bool:
        return CLOSED in self.words.split()

    @property
    def is_shell(self) -> bool:
        return self.language in SHELLS

    @property
    def is_script(self) -> bool:
        return self.language == "python"

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


def blocks(page: Page | Path) -> list[Block]:
    """Every fenced block, in the page's order."""
    text = page.text if isinstance(page, Page) else page.read_text(encoding="utf-8")
    return [Block(*found.groups()) for found in _FENCE.finditer(text)]


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


def prose(page: Page) -> str:
    """Its text and tables, without the blocks."""
    return _FENCE.sub("", page.text)


def pages() -> list[Page]:
    """All of which every shell block is run."""
    found = [page for kind in RUN_KINDS for page in sorted((DOCS / kind).glob("*.md"))]
    return [
        *_sections(README),
        *(Page(page.relative_to(DOCS).as_posix(), page.read_text(encoding="utf-8")) for page in found),
    ]


def _sections(file: Path) -> list[Page]:
    """Each begins a walk of its own, in a home of its own."""
    text = file.read_text(encoding="utf-8")
    fenced = [range(*found.span()) for found in _FENCE.finditer(text)]
    leads = [found for found in _LEAD.finditer(text) if not any(found.start() in one for one in fenced)]
    ends = [lead.start() for lead in leads[1:]] + [len(text)]
    return [
        Page(f"{file.name}: {lead[1] or lead[2]}", text[lead.end() : end])
        for lead, end in zip(leads, ends, strict=True)
    ]
