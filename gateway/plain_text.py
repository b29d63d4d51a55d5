"""Foreign text made safe to show: no character of it can command the terminal."""

import re
from typing import Final

LONGEST_NAME: Final = 128
NAME_SIGNS: Final = "letters, digits and _ . @ : + -"
ROBOT_SIGNS: Final = f"{NAME_SIGNS} # , ( ) and spaces"
_NAME: Final = re.compile(r"\w[\w.@:+-]*")
_ROBOT_NAME: Final = re.compile(r"\w[\w.@:+#,() -]*")


def followed(text: str, sentence: str) -> str:
    """Return a text that may lack its last sign, and a sentence after it."""
    return f"{text}{'' if text[-1:] in '.?!…' else '.'} {sentence}"


def is_name(text: str) -> bool:
    """Return whether a desk takes this as the name of a component, channel or parameter."""
    return len(text) <= LONGEST_NAME and _NAME.fullmatch(text) is not None


def is_robot_name(text: str) -> bool:
    """Return whether a desk takes this as what a robot calls itself."""
    return len(text) <= LONGEST_NAME and _ROBOT_NAME.fullmatch(text) is not None


def plain(text: str, keep: str = "") -> str:
    r"""Every letter that cannot be printed as its escape (`\x1b`, `\n`, `\u202e`), but for those in `keep`.

    Markup of rich and HTML stays as it is, and is shown as text: rich gets it as `Text`, Qt as plain text.
    """
    if text.isprintable():
        return text
    return "".join(one if one in keep or one.isprintable() else _escaped(one) for one in text)


def one_line(text: str) -> str:
    """Return what somebody else says without lines of its own, which would look like ours."""
    return " ".join(text.split())


def json_plain(text: str) -> str:
    """Return a line of JSON in which nothing commands a terminal; it says the same to machines."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else _json_escaped(one) for one in text)


def _escaped(letter: str) -> str:
    return letter.encode("unicode_escape", "surrogatepass").decode()


def _json_escaped(letter: str) -> str:
    units = letter.encode("utf-16-be", "surrogatepass")
    return "".join(f"\\u{units[at] << 8 | units[at + 1]:04x}" for at in range(0, len(units), 2))
