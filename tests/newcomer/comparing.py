"""Whether output is what a page shows: numbers, times and widths of columns may differ, words may not."""

import re
from collections.abc import Sequence
from itertools import groupby

_NUMBER = re.compile(r"(?:(?<!\w)[-−+±])?\d(?:[\d.,:TZ]*\d)?")
_LEFT_OUT = "…"  # of a line, or as a line of its own: any number of lines


def difference(shown: Sequence[str], output: str) -> str | None:
    """The first shown lines that do not come, in words."""
    wanted = [line for line in map(_plain, shown) if line]
    lines = [line for line in map(_plain, output.splitlines()) if line]
    if not wanted:
        return None
    place, free = 0, False
    for left_out, group in groupby(wanted, _LEFT_OUT.__eq__):
        run = [] if left_out else list(group)
        last = len(lines) - len(run)
        found = next(
            (at for at in range(place, last + 1 if free else place + 1) if _fits(run, lines, at)), None
        )
        if found is None:
            told = "\n".join(run)
            return f"{told!r} is not where it is shown; the output was\n{output}"
        place, free = found + len(run), left_out
    if not free and place < len(lines):
        return f"{lines[place]!r} is not shown; the output was\n{output}"
    return None


def _fits(run: Sequence[str], lines: Sequence[str], at: int) -> bool:
    there = lines[at : at + len(run)]
    return len(there) == len(run) and all(
        re.fullmatch(".*".join(map(re.escape, line.split(_LEFT_OUT))), said)
        for line, said in zip(run, there, strict=True)
    )


def _plain(line: str) -> str:
    return " ".join(_NUMBER.sub("#", line).split())
