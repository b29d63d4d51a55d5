"""Command lines without the secrets that stand in them, in time that grows as their length does."""

import re
from collections.abc import Callable, Iterator

HIDDEN = "***"

_SECRET = re.compile(
    r"pass(?!ive)|pwd|secret|token|credential|(?:api|access|private)[-_]?key|auth(?!or)|bearer|psk|cookie"
    r"|signature",
    re.IGNORECASE,
)
_KEY = re.compile(r"(?:[A-Z0-9]++_)*+KEYS?+")  # of an environment, as in SIGNING_KEY=…
_SETTING = re.compile(r"(?:.*[.-])?(?:psk|password)", re.IGNORECASE)  # a word whose value is the next one
_NAME = re.compile(r"[\w.-]++")
_GIVEN = re.compile(r"\s*+[=:]\s*+(?:(?:bearer|basic)\s++)?+", re.IGNORECASE)
_SPACE = re.compile(r"\s++")
_WORD = re.compile(r"[^\0]++")  # one of the command line's, which NULs part
_VALUE = re.compile(
    r"""(?:'[^'\0]*+'?+|"[^"\0]*+"?+|[^\s\0'"]++)++"""
)  # within a word that a shell is to read
_PIECE = re.compile(r"[^\s\0]++")
_URL = re.compile(r"(?<![\w+.-])[\w+.-]++://")

# Programs whose option of one letter is followed by a secret: at once, or in the next word where it may be.
_ATTACHED = {"mysql": "-p", "mariadb": "-p", "7z": "-p"}
_FOLLOWED = {
    "sshpass": "-p",
    "docker": "-p",
    "mongo": "-p",
    "mongosh": "-p",
    "redis-cli": "-a",
    "ldapsearch": "-w",
    "mosquitto_pub": "-P",
    "mosquitto_sub": "-P",
    "unzip": "-P",
    "zip": "-P",
}
_USER = ("-u", "--u", "-user", "--user")  # NAME:PASSWORD

Span = tuple[int, int]


def redact(words: list[str]) -> str:
    """Return a command line without the values of what is named like a secret, and without users in URLs.

    It cannot know every program's own way: a secret that nothing names is shown.
    """
    line = "\0".join(words)
    for find in (_named, _options, _users):
        line = _without(line, find)
    return line.replace("\0", " ")


def _without(line: str, find: Callable[[str], Iterator[Span]]) -> str:
    """Return the line with these spans hidden; they come in order."""
    shown, at = [], 0
    for begin, end in find(line):
        if begin >= at and end > begin:
            shown += [line[at:begin], HIDDEN]
            at = end
    return "".join([*shown, line[at:]])


def _named(line: str) -> Iterator[Span]:
    """Yield the values that follow names of secrets.

    Each letter is looked at a few times at most.
    """
    at = 0
    while name := _NAME.search(line, at):
        at = name.end()
        found = _value_of(line, name)
        if found is not None:
            at = found[1]
            yield found


def _value_of(line: str, name: re.Match[str]) -> Span | None:
    end, first = name.end(), name.start() == 0 or line[name.start() - 1] == "\0"
    text = name[0]
    if line.startswith("=", end) and _KEY.fullmatch(text):
        return _span(_WORD if first else _VALUE, line, end + 1)
    if text.lower() == "basic":
        space = _SPACE.match(line, end)
        return None if space is None else _span(_VALUE, line, space.end())
    if _SECRET.search(text) is None or text in _FOLLOWED:
        return None
    if _SETTING.fullmatch(text) and first and name.start() and line.startswith("\0", end):
        return _span(_WORD, line, end + 1)
    if first and text.startswith("-") and line.startswith("\0", end):  # --password, and the word after it
        return _span(_WORD, line, end + 1)
    if first and line.startswith("=", end):  # PASSWORD=… up to the word's end
        return _span(_WORD, line, end + 1)
    given = _GIVEN.match(line, end) or _SPACE.match(line, end)
    return None if given is None else _span(_VALUE, line, given.end())


def _options(line: str) -> Iterator[Span]:
    """Yield the values of secret options of known programs, and passwords after user names."""
    attached = followed = before = ""
    for piece in _PIECE.finditer(line):
        text, begin, end = piece[0], *piece.span()
        found: Span | None = None
        if before and before == followed:
            found = _span(_VALUE, line, begin) or (begin, end)
        elif len(text) > 2 and text[:2] in {attached, followed} - {""}:
            found = _span(_VALUE, line, begin + 2) or (begin + 2, end)
        if found is not None:
            attached = followed = ""  # there is one
            yield found
        elif ":" in text and (before in _USER or text.startswith("--user=")):
            yield begin + text.index(":") + 1, end
        program = text.rpartition("/")[2]
        if not text.startswith("-") and (program in _FOLLOWED or _family(program) in _ATTACHED):
            attached, followed = _ATTACHED.get(_family(program), ""), _FOLLOWED.get(program, "")
        before = text


def _family(program: str) -> str:
    """`mysql` for what comes with it, such as `mysqldump`; else the program itself."""
    return next((name for name in ("mysql", "mariadb", "7z") if program.startswith(name)), program)


def _users(line: str) -> Iterator[Span]:
    """User and password before the host of a URL; they may hold what should have been escaped."""
    at = 0
    while url := _URL.search(line, at):
        piece = _PIECE.match(line, url.end())
        at = url.end() if piece is None else piece.end()
        if piece is None:
            continue
        place = re.split(r"[/?#]", piece[0], maxsplit=1)[0]
        last = (piece[0] if ":" in place else place).rfind("@")
        if last >= 0:
            yield url.end(), url.end() + last


def _span(pattern: re.Pattern[str], line: str, at: int) -> Span | None:
    found = pattern.match(line, at)
    return None if found is None else found.span()
