"""The pages of the docs: as they were installed, or as they lie in a working copy."""

import re
from pathlib import Path
from typing import Final

_INSTALLED: Final = Path(__file__).with_name("docs")
_WORKING_COPY: Final = Path(__file__).parents[1] / "docs"


def folder() -> Path:
    """Return the folder of the pages."""
    return _INSTALLED if _INSTALLED.is_dir() else _WORKING_COPY


def pages() -> dict[str, Path]:
    """Return every page by its name, such as `how-to/predict`."""
    found = sorted(folder().rglob("*.md"))
    return {str(page.relative_to(folder()).with_suffix("")): page for page in found}


def find(name: str) -> Path | None:
    """Return the page that is meant by `how-to/predict`, `predict` or a link to it.

    None where there is none.
    """
    known = pages()
    by_last = {page.rpartition("/")[2]: path for page, path in known.items()}
    wanted = name.removeprefix("docs/").removesuffix(".md")
    return known.get(wanted) or by_last.get(wanted)


def about(words: str) -> list[str]:
    """Return the names of the pages whose titles have these words, or else one of them."""
    wanted = set(_words(words))
    found = {name: len(wanted & set(_words(title(page)))) for name, page in pages().items()}
    most = max(found.values(), default=0)
    likely = [name for name, count in found.items() if count == most > 0]
    return [name for name in likely if not name.startswith("adr/")] or likely  # a decision is rarely meant


def _words(text: str) -> list[str]:
    return re.findall(r"[a-z0-9]{3,}", text.lower())


def title(page: Path) -> str:
    """Return the title of a page: its first heading."""
    with page.open(encoding="utf-8") as lines:
        return next((line.strip("# \n") for line in lines if line.startswith("# ")), "")
