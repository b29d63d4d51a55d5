"""Whether output is what a page shows: numbers, times and widths of columns may differ, words may not."""

import re
from collections.abc import Sequence

_NUMBER = re.compile(r"(?:(?<!\w)[-−+±])?\d(?:[\d.,:TZ]*\d)?")
_LEFT_OUT = "…"  # of a line, or as a line of its own: any number of lines


def difference(shown: Sequence[str], output: str) -> str | None:
    """The first shown line that does not come, in words."""
    wanted = [line for line in map(_plain, shown) if line]
    lines = [line for line in map(_plain, output.splitlines()) if line]
    place, free = 0, False
    for line in wanted:
        if line == _LEFT_OUT:
            free = True
            continue
        pattern = re.compile(".*".join(map(re.escape, line.split(_LEFT_OUT))))
        found = next((at for at in range(place, len(lines)) if pattern.fullmatch(lines[at])), None)
        if found is None or (found > place and not free):
            return f"{line!r} is not where it is shown; the output was\n{output}"
        place, free = found + 1, False
    if wanted and not free and place < len(lines):
        return f"{lines[place]!r} is not shown; the output was\n{output}"
    return None


def _plain(line: str) -> str:
    return " ".join(_NUMBER.sub("#", line).split())
