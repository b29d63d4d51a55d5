"""The manual of the window, a section at a time: a page of the docs, which are in the package."""

import re
from typing import Final

from gateway.pages import folder

_IMAGE, _LINK = re.compile(r"!\[[^\]]*\]\([^)]*\)\n*"), re.compile(r"\[([^\]]+)\]\([^)]*\)")
_LEFT_OUT: Final = ("How it is made",)


def sections() -> dict[str, str]:
    """Markdown by title, in the manual's order: without pictures, and with links as their words."""
    text = (folder() / "reference" / "window.md").read_text(encoding="utf-8")
    found: dict[str, str] = {}
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title, _, body = part.partition("\n")
        if title not in _LEFT_OUT:
            found[title] = _LINK.sub(r"\1", _IMAGE.sub("", body)).strip()
    return found
