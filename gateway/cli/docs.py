"""`gwrms docs`: the pages that help and messages name, where there is no network."""

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import Final

from gateway.cli.text import did_you_mean, say, table, warn
from gateway.pages import about, find, pages, title

_MOST: Final = 3  # pages that are proposed
_DESCRIPTION = """\
Print a page of the installed documentation; without a name, list all pages. The last part of a page's name is
enough if no other page has it.
"""
_EPILOG = """\
exit status: 0 printed; 1 there is no such page; 2 usage

examples
  gwrms docs
  gwrms docs first-robot | less
  gwrms docs reference/robot-toml
"""


def main(argv: list[str]) -> int:
    """Run `gwrms docs`."""
    wanted = _parser().parse_args(argv).page
    known = pages()
    if wanted is None:
        say(table(("PAGE", ""), [(name, title(page)) for name, page in known.items()]))
        return 0
    page = find(wanted)
    if page is not None:
        say(page.read_text(encoding="utf-8"))
        return 0
    warn("docs", f"there is no page {wanted!r}{_close(wanted, known)} all are listed by gwrms docs")
    return 1


def _close(wanted: str, known: Mapping[str, Path]) -> str:
    """Return the pages whose titles have its words, or else those whose names are spelled nearly so."""
    word = wanted.rpartition("/")[2]
    if found := [f"{name} ({title(known[name])})" for name in about(word)[:_MOST]]:
        return f"; did you mean {' or '.join(found)}?"
    return did_you_mean(word, {name.rpartition("/")[2] for name in known}) or ";"


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="gwrms docs",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    parser.add_argument("page", nargs="?", metavar="PAGE", help="a name from the list, or a link")
    return parser
