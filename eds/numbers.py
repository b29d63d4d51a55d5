"""Numbers as EDS files write them: decimal, 0x…, octal, 10h, and relative to $NODEID (CiA 306 §4.3)."""

import re

_MAX_DIGITS = 40  # a 64-bit number in any spelling is far shorter
_DECIMAL = re.compile(r"[+-]?(?:0|[1-9][0-9]*)")
_HEX = re.compile(r"[+-]?0[xX][0-9A-Fa-f]+")
_HEX_SUFFIX = re.compile(r"([0-9][0-9A-Fa-f]*)[hH]")
_LEADING_ZERO = re.compile(r"([+-]?)0+([0-9]+)")
_NODE_ID = re.compile(r"\$?NODEID", re.IGNORECASE)


def parse_integer(text: str) -> int | None:
    """Return the number, or `None` where the text is none, or can be read in two ways.

    CiA 306 reads a leading zero as octal; many tools write it meaning decimal. Where both readings
    agree (`007`) there is no doubt; where they do not (`0010`) the number is unknown.
    """
    text = text.replace(" ", "").rstrip("uUlL")
    if len(text) > _MAX_DIGITS:
        return None
    if _DECIMAL.fullmatch(text):
        return int(text)
    if _HEX.fullmatch(text):
        return int(text, 16)
    if match := _HEX_SUFFIX.fullmatch(text):
        return int(match[1], 16)
    if match := _LEADING_ZERO.fullmatch(text):
        decimal = int(match[1] + match[2])
        octal_digits = set(match[2]) <= set("01234567")
        return decimal if octal_digits and int(match[1] + match[2], 8) == decimal else None
    return None


def parse_relative(text: str) -> int | None:
    """Return the number added to the node id in `$NODEID+0x180`, `0x180 + $NODEID` or `NODEID`.

    `None` elsewhere.
    """
    if not _NODE_ID.search(text):
        return None
    rest = _NODE_ID.sub("", text, count=1).replace(" ", "").strip("+")
    return parse_integer(rest) if rest else 0
