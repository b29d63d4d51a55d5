"""Output of the commands: aligned tables for people, one JSON line for machines."""

import difflib
import sys
from collections.abc import Iterable, Sequence
from typing import Final

import msgspec

from gateway.amounts import NONE, percent
from gateway.coding import text as digits
from gateway.plain_text import json_plain, plain
from gateway.wire.component import ChannelInfo
from gateway.wire.cost import BudgetInfo

PAGE: Final = 100  # columns of a text that is filled
DECIMALS = {"Pa": 0, "B": 0, "N": 1, "°C": 1, "%": 1}  # of a measured value; a parameter is shown whole
OTHER_DECIMALS = 4
YES_OR_NO: Final = " [y/N] "  # ends a question; its answer is typed after it


def table(header: Sequence[str], rows: Iterable[Sequence[str]], right: Iterable[int] = ()) -> str:
    """Aligned columns two spaces apart; the columns in `right` (by index) are right-aligned."""
    lines = [tuple(map(plain, header)), *(tuple(map(plain, row)) for row in rows)]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    numeric = frozenset(right)
    return "".join(
        "  ".join(
            cell.rjust(width) if index in numeric else cell.ljust(width)
            for index, (cell, width) in enumerate(zip(line, widths, strict=True))
        ).rstrip()
        + "\n"
        for line in lines
    )


def say(text: str) -> None:
    """Print for people; letters that would command the terminal are shown as what they are."""
    sys.stdout.write(plain(text, "\n"))
    sys.stdout.flush()


def say_json(answer: object) -> None:
    """Print for machines: one line, flushed, so that a pipe sees it at once."""
    sys.stdout.write(json_plain(msgspec.json.encode(answer).decode()) + "\n")
    sys.stdout.flush()


def warn(command: str, text: str) -> None:
    """Print a warning on stderr; no line of it can pass for another warning."""
    shown = plain(text, "\n").replace("\n", "\n  ")
    sys.stderr.write(f"gwrms {command}: {shown}\n")


def measured(value: float | None, channel: ChannelInfo | None = None) -> str:
    """Return a channel's value.

    A state as its word, a number with few decimals, a dash where there is none.
    """
    if value is None:
        return NONE
    unit = "" if channel is None else channel.unit
    if channel is None or unit or not value.is_integer():
        return f"{value:.{DECIMALS.get(unit, OTHER_DECIMALS)}f}"
    return (channel.enum or {}).get(str(int(value)), str(int(value)))


def exact(value: float | None) -> str:
    """Return a parameter's value, with every digit that it has."""
    return NONE if value is None else digits(value)


def budget(info: BudgetInfo) -> str:
    """Return the gateway's CPU budget, and the thinning of its streams to keep it, in words."""
    shed = f": streams send one row of {info.shed}" if info.shed > 1 else ""
    return f"at most {percent(info.max_cpu_percent)} of a core{shed}"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return names that come close to one that does not exist, as the end of a sentence."""
    close = difflib.get_close_matches(name, list(known), n=3, cutoff=0.5)
    return f"; did you mean {' or '.join(close)}?" if close else ""
