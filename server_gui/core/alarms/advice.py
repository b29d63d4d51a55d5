"""What a robot says of a part, and what to check, which may stand in the same words."""

import re
from typing import Final

_ADVICE: Final = re.compile(r": (?=(?:check|plug|see) )")  # with which what the robot says of a part may end
_ANOTHER: Final = re.compile(r"(?:it reports|the drive is|its|no|nothing|node|\d+ %|0x[0-9A-Fa-f]{4}) ?\b")


def split_advice(problem: str) -> tuple[str, str]:
    """Split a problem into what is wrong and what to check: `this: check that; it goes on; more: …`.

    What goes on after an advice belongs to it, unless it begins as only what is wrong does.
    """
    things, advice = list[str](), list[str]()
    for clause in problem.split("; "):
        thing, *check = _ADVICE.split(clause, maxsplit=1)
        if not check and advice and not _ANOTHER.match(clause):
            advice[-1] += f"; {clause}"
        else:
            things.append(thing)
            advice += check
    return "; ".join(things), "; ".join(dict.fromkeys(advice))
