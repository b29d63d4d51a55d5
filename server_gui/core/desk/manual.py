"""The manual of the window, a section at a time: the very text of docs/window.md, which is in the package."""

import re
from importlib import resources
from pathlib import Path
from typing import Final

SHIPPED: Final = "window.md"  # beside this package's code, where it was built from docs
_IMAGE, _LINK = re.compile(r"!\[[^\]]*\]\([^)]*\)\n*"), re.compile(r"\[([^\]]+)\]\([^)]*\)")
_LEFT_OUT: Final = ("How it is made",)


def sections() -> dict[str, str]:
    """Markdown by title, in the manual's order: without pictures, and with links as their words."""
    found: dict[str, str] = {}
    for part in re.split(r"^## ", _text(), flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        if title not in _LEFT_OUT:
            found[title] = _LINK.sub(r"\1", _IMAGE.sub("", body)).strip()
    return found


def _text() -> str:
    shipped = resources.files("server_gui") / SHIPPED
    if shipped.is_file():
        return shipped.read_text(encoding="utf-8")
    return (Path(__file__).parents[3] / "docs" / SHIPPED).read_text(encoding="utf-8")  # a working copy
