"""Command lines without the secrets that stand in them."""

import re

HIDDEN = "***"

_SECRET = r"(?:pass(?!ive)|pwd|secret|token|credential|(?:api|access|private)[-_]?key|auth(?!or)|bearer)"
_NAME = rf"(?<![\w.-])[\w.-]*{_SECRET}[\w.-]*+"  # begins and ends where a name does, so that it is quick
_START = r"(?:^|(?<=\0))"  # of one of the command line's words, which NULs part

# What shows, followed by what does not.
_PATTERNS = tuple(
    re.compile(f"({shows}){hides}", re.IGNORECASE)
    for shows, hides in (
        (rf"{_START}-[\w.-]*{_SECRET}[\w.-]*+\0", r"[^\0]+"),  # --password, and the word after it
        (rf"{_START}{_NAME}=", r"[^\0]+"),  # PASSWORD=… up to the word's end
        (rf"{_NAME}\s*[=:]\s*(?:(?:bearer|basic)\s+)?", r"[^\s\0]+"),  # the same within a word
        (rf"{_NAME}\s+", r"[^\s\0]+"),
        (r"\bbasic\s+", r"[^\s\0]+"),
        (r"(?<![^\s\0])--?u(?:ser)?[\0\s=][^\s\0:]+:", r"[^\s\0]+"),  # --user NAME:PASSWORD
        (r"(?<!\w)\w+://", r"[^/\s\0]*(?=@)"),
    )
)


def redact(words: list[str]) -> str:
    """A command line without the values of what is named like a secret, and without users in URLs.

    It cannot know every program's own way: a secret that nothing names is shown.
    """
    line = "\0".join(words)
    for pattern in _PATTERNS:
        line = pattern.sub(rf"\1{HIDDEN}", line)
    return line.replace("\0", " ")
