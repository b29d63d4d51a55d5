"""Links of Markdown files lead somewhere, also those that the site leaves to the repository."""

import functools
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
_PARTS = (
    "docs",
    "docker",
    "scenarios",
    "tests",
    "tools",
    "gwrms",
    "eds",
    "hil_sim",
    "drivers",
    "gateway",
    "server_gui",
    "ml",
)
PAGES = sorted([*ROOT.glob("*.md"), *(page for part in _PARTS for page in (ROOT / part).rglob("*.md"))])
_FENCED = re.compile(r"^```.*?^```$", re.MULTILINE | re.DOTALL)
_LINK = re.compile(r"\]\((?!https?:|mailto:)([^)#\s]*)(?:#([^)\s]*))?\)")


def anchors(page: Path) -> set[str]:
    """Of its headings, as GitHub and the site make them."""
    text = _FENCED.sub("", page.read_text(encoding="utf-8"))
    heads = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", head.lower()).replace(" ", "-") for head in heads}


@functools.cache
def known_files() -> frozenset[str]:
    """Every file of ours that may be named by the end of its path."""
    return frozenset(
        file.relative_to(ROOT).as_posix()
        for part in (*_PARTS, "tools")
        for file in (ROOT / part).rglob("*.py")
    )


def named_files(text: str) -> list[str]:
    """Paths of this repository in code spans, whole or from within a house; not those of the reader's own."""
    houses = "|".join([*_PARTS, "tools", "scenarios"])
    found = re.findall(rf"`((?:{houses})/(?:[\w./-]*(?:/|\.py))?|[\w/]+\.py)`", _FENCED.sub("", text))
    return [path for path in found if not re.search(r"mine|[A-Z]{4}", path)]


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_leads_somewhere(page: Path) -> None:
    wrong = []
    for target, anchor in _LINK.findall(_FENCED.sub("", page.read_text(encoding="utf-8"))):
        there = (page.parent / target).resolve() if target else page
        if not there.exists() or (anchor and anchor not in anchors(there)):
            wrong.append(f"{target}#{anchor}" if anchor else target)
    assert wrong == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_file_that_is_named_is_there(page: Path) -> None:
    named = named_files(page.read_text(encoding="utf-8")) if page.name != "CHANGELOG.md" else []
    wrong = [path for path in named if not (ROOT / path).exists()]
    assert [path for path in wrong if not any(f"/{one}".endswith(f"/{path}") for one in known_files())] == []
