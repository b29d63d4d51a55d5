"""A hook of mkdocs: what in a page is for the repository alone, as the site needs it.

A link to a file of the repository that is no page becomes that file's name, and must lead somewhere. Words
behind a block's language, which say how it is tested, are left out.
"""

import posixpath
import re
from pathlib import Path
from typing import Any, Final

from mkdocs.plugins import get_plugin_logger

ROOT: Final = Path(__file__).parents[1]
_LINK: Final = re.compile(r"(?<!!)\[([^\]]+)\]\(((?:\.\./)+[^)#\s]+)(#[^)\s]*)?\)")
_WORDS: Final = re.compile(r"^(```(?:sh|console)) (?:by-hand|terminal)$", re.MULTILINE)
log = get_plugin_logger("site_links")  # what it warns of fails a strict build


def on_page_markdown(markdown: str, page: Any, **_more: Any) -> str:
    """Called by mkdocs with the text of each page."""
    folder = posixpath.dirname(f"docs/{page.file.src_uri}")

    def shown(found: re.Match[str]) -> str:
        words, target, _anchor = found.groups()
        path = posixpath.normpath(posixpath.join(folder, target))
        if path.startswith("docs/"):
            return found[0]
        if not (ROOT / path).exists():
            log.warning("%s: there is no %s", page.file.src_uri, path)
        name = words.strip("`")
        return f"`{path}`" if name in path else f"{words} (`{path}`)"

    return _LINK.sub(shown, _WORDS.sub(r"\1", markdown))
