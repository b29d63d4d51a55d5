"""gateway/drawn/: every command for `--help` where a part of GWRMS is missing, for shells, and for man."""

import argparse
import contextlib
import functools
import io
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import msgspec
import shtab

from gateway import main
from gateway.cli.completion import SHELLS
from gateway.missing_extras import DRAWN, Argument, Page
from hil_sim.exoskeleton import CONTROLLER, JOINTS, SENSORS
from hil_sim.faults.registry import FAULTS
from hil_sim.gait.activity import Activity
from hil_sim.operator import CONTROLLER_COMMANDS, EVERYTHING
from tools.draw.commands import ALONE, WORDS, commands, parser_of


def help_pages() -> str:
    """Return every command's help as data; `gateway/missing_extras.py` makes parsers of it again."""
    pages = {" ".join(one.words): _page(one.parser) for one in commands()}
    pages |= {name: Page(text=_said(name)) for name in WORDS if name not in pages}
    return msgspec.json.format(msgspec.json.encode(dict(sorted(pages.items()))), indent=1).decode() + "\n"


def completion(shell: str) -> str:
    """Return the script that completes the command line in this shell."""
    found: str = shtab.complete(_tree(), shell=shell)
    return found


def man() -> str:
    """Return the manual's page, with every command."""
    lines = [
        ".TH GWRMS 1",
        ".SH NAME",
        r"gwrms \- watches and tunes lower-limb exoskeletons",
        ".SH SYNOPSIS",
        ".B gwrms",
        "COMMAND [ARGUMENTS]",
        ".SH COMMANDS",
    ]
    for name, (_, what) in main.COMMANDS.items():
        lines += [".TP", f".B {name}", _roff(what)]
    for one in commands():
        lines += [f".SH GWRMS {' '.join(one.words).upper()}", *_manual(_page(one.parser))]
    return "\n".join(lines) + "\n"


def _manual(page: Page) -> Iterator[str]:
    yield _roff(" ".join(page.description.split()))
    for each in page.arguments:
        value = " ".join(each.metavar) if isinstance(each.metavar, tuple) else each.metavar or ""
        yield ".TP"
        yield rf"\fB{_roff(', '.join(each.names))}\fR {_roff(value)}".rstrip()
        yield _roff(each.help.replace("%%", "%"))
    if page.epilog:
        yield from (".PP", ".nf", *map(_roff, page.epilog.strip("\n").splitlines()), ".fi")


def _roff(text: str) -> str:
    escaped = text.replace("\\", r"\e").replace("-", r"\-").replace("\n", " ")
    return f"\\&{escaped}" if escaped[:1] in (".", "'") else escaped


def _page(parser: argparse.ArgumentParser) -> Page:
    groups = {
        id(action): place
        for place, group in enumerate(parser._mutually_exclusive_groups)  # noqa: SLF001 - told nowhere else
        for action in group._group_actions  # noqa: SLF001
    }
    arguments = [
        _argument(action, parser, groups.get(id(action)))
        for action in parser._actions  # noqa: SLF001
        if action.option_strings[:1] != ["-h"]
    ]
    return Page(
        description=parser.description or "",
        epilog=parser.epilog or "",
        usage=parser.usage,
        is_filled=parser.formatter_class is argparse.HelpFormatter,
        arguments=tuple(arguments),
    )


def _argument(action: argparse.Action, parser: argparse.ArgumentParser, group: int | None) -> Argument:
    said = (action.help or "") % (vars(action) | {"prog": parser.prog})
    choices = None if action.choices is None else tuple(map(str, action.choices))
    shown = None if choices or not action.option_strings or action.nargs == 0 else action.dest.upper()
    return Argument(
        names=tuple(action.option_strings) or (action.dest,),
        help=said.replace("%", "%%"),
        metavar=action.metavar or shown,
        nargs=action.nargs,
        choices=choices,
        required=action.required,
        group=group,
    )


# By command and argument: names that the command knows, and tells itself where another is typed.
_NAMES: Final[Mapping[tuple[str, str], list[str]]] = {
    ("gwrms sim-fault", "name"): [*FAULTS],
    ("gwrms sim-fault", "clear"): [EVERYTHING, *FAULTS],
    ("gwrms sim-fault", "on"): [*JOINTS, CONTROLLER, *SENSORS],
    ("gwrms sim-fault", "activity"): [one.name.lower() for one in Activity],
    ("gwrms sim-fault", "controller"): [*CONTROLLER_COMMANDS],
}


def _said(name: str) -> str:
    with contextlib.redirect_stdout(io.StringIO()) as said:
        main.find(name)(["--help"])
    return said.getvalue()


def _tree() -> argparse.ArgumentParser:
    """One parser with all commands in it; nothing is ever parsed by it."""
    root = argparse.ArgumentParser(prog="gwrms")
    below = root.add_subparsers(metavar="COMMAND")
    for name, (_, what) in main.COMMANDS.items():
        words = WORDS.get(name, ())
        made = _add(below, name, what, None if words and name not in ALONE else parser_of((name,)))
        if words:
            further = made.add_subparsers(metavar="COMMAND")
            for word in words:
                parser = parser_of((name, word))
                _add(further, word, _first(parser), parser)
    return root


def _add(below: Any, name: str, what: str, parser: argparse.ArgumentParser | None) -> argparse.ArgumentParser:
    made: argparse.ArgumentParser = below.add_parser(name, help=what)
    if parser is not None:
        made = below._name_parser_map[name] = parser  # noqa: SLF001 - one that is made already
        _complete(parser)
    return made


def _complete(parser: argparse.ArgumentParser) -> None:
    """Files where a path is wanted, and names where only some are known."""
    for action in parser._actions:  # noqa: SLF001
        action.choices = _NAMES.get((parser.prog, action.dest), action.choices)
        if action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]


def _first(parser: argparse.ArgumentParser) -> str:
    return " ".join((parser.description or "").split()).partition(". ")[0]


PAGES: Final[Mapping[str, Callable[[], str]]] = {
    DRAWN: help_pages,
    **{f"gwrms.{shell}": functools.partial(completion, shell) for shell in SHELLS},
    "gwrms.1": man,
}
