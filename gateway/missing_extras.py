"""Extras that are not installed: which one a command needs, and that command's help without it.

Parsers are made where their commands are, beside all that these import. So that `--help` needs none of it,
they are also written down in `drawn/commands.json`, from which they are made again.
"""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import msgspec

FOLDER: Final = Path(__file__).with_name("drawn")  # by tools/draw/packaged.py
DRAWN: Final = "commands.json"
_BRINGS: Final = {  # all else that a robot does not need comes with `collect`
    "rich": "sim",
    "duckdb": "query",
    "mcap": "query",
    "mcap_ros2": "query",
    "PySide6": "server",
    "PySide6-Essentials": "server",
    "pyqtgraph": "server",
    "distributed": "cluster",
    "onnxruntime": "onnx",
    "skl2onnx": "onnx",
    "google": "onnx",
}
_ENOUGH: Final = {
    "demo": "sim",
    "top": "sim",
    "gui": "server",
    "query": "query",
}  # commands that need less, or more, than what else needs the same package


class Argument(msgspec.Struct, frozen=True, omit_defaults=True):
    """An option or a positional argument, as `argparse` takes it."""

    names: tuple[str, ...]
    help: str = ""
    metavar: str | tuple[str, ...] | None = None
    nargs: str | int | None = None
    choices: tuple[str, ...] | None = None
    required: bool = False
    group: int | None = None  # of options of which only one may be given


class Page(msgspec.Struct, frozen=True, omit_defaults=True):
    """The help of a command: its parser's, or of a group of commands its text."""

    text: str = ""
    description: str = ""
    epilog: str = ""
    usage: str | None = None  # where it is not that of the arguments
    is_filled: bool = False  # its lines are made as long as the screen is wide
    arguments: tuple[Argument, ...] = ()


def extra_of(package: str, command: str = "") -> str:
    """Return the extra of GWRMS that installs what is imported as `package`, as far as `command` needs it."""
    return _ENOUGH.get(command) or _BRINGS.get(package.partition(".")[0], "collect")


def explained(package: str, command: str = "") -> str:
    """Return the remedy, in words, for a package that `command` lacks."""
    if package in sys.stdlib_module_names:
        return f"this does not run on {sys.platform}, where Python has no {package!r}: use Linux"
    extra = extra_of(package, command)
    return (
        f"this needs the package {package!r}, which is not installed; "
        f"pip install 'gwrms[{extra}]' brings it (in a checkout: pip install '.[{extra}]'); "
        "gwrms docs install says more"
    )


def help_of(words: Sequence[str]) -> str | None:
    """Return the help of a command as it was written down; None where it is not asked for, or not known."""
    asked = next((place for place, word in enumerate(words) if word in ("-h", "--help")), None)
    if asked is None:
        return None
    drawn = (FOLDER / DRAWN).read_bytes()
    pages = msgspec.json.decode(drawn, type=dict[str, Page])
    for name in (" ".join(words[: min(asked, count)]) for count in (2, 1)):
        if page := pages.get(name):
            return page.text or _parser(name, page).format_help()
    return None


def _parser(name: str, page: Page) -> argparse.ArgumentParser:
    made = argparse.ArgumentParser(
        prog=f"gwrms {name}",
        description=page.description or None,
        epilog=page.epilog or None,
        usage=page.usage,
        formatter_class=argparse.HelpFormatter if page.is_filled else argparse.RawDescriptionHelpFormatter,
    )
    groups: dict[int, Any] = {}
    for each in page.arguments:
        target: Any = made
        if each.group is not None:
            if each.group not in groups:
                groups[each.group] = made.add_mutually_exclusive_group()
            target = groups[each.group]
        target.add_argument(*each.names, **_how(each))
    return made


def _how(argument: Argument) -> dict[str, Any]:
    how: dict[str, Any] = {"help": argument.help, "metavar": argument.metavar}
    if argument.nargs == 0:
        return {"help": argument.help, "action": "store_true"}
    if argument.required and argument.names[0].startswith("-"):
        how["required"] = True
    return how | {"nargs": argument.nargs, "choices": argument.choices}
