"""The decoder's errors in words for the author of the message or file."""

import re

_KINDS = {
    "str": "text",
    "int": "a whole number",
    "float": "a number",
    "bool": "true or false",
    "object": "an object",
    "array": "a list",
    "null": "nothing",
}
_PATTERNS = (  # msgspec's messages, and ours
    (r"Expected `int`, got `float`", "must be a whole number, not a fraction"),
    (r"Expected `(?P<want>[^`]+)`, got `(?P<got>[^`]+)`", "must be {want}, not {got}"),
    (r"Expected `str` of length <= (?P<n>\d+)", "has more than {n} characters"),
    (r"Expected `(?:str|array|object)` of length >= 1", "must not be empty"),
    (r"Expected `str` matching regex (?P<n>.+)", "must have the form {n}"),
    (r"Expected `array` of length <= (?P<n>\d+)", "has more than {n} entries"),
    (r"Expected `array` of length (?P<n>\d+), got (?P<m>\d+)", "must have {n} entries, not {m}"),
    (r"Expected `int` that's a multiple of (?P<n>\d+)", "must be a multiple of {n}"),
    (r"Expected `(?P<want>[^`]+)` >= (?P<n>\S+?)(\.0)?", "must be {want}, at least {n}"),
    (r"Expected `(?P<want>[^`]+)` <= (?P<n>\S+?)(\.0)?", "must be {want}, at most {n}"),
    (r"Expected `(?P<want>[^`]+)` > (?P<n>\S+?)(\.0)?", "must be {want} above {n}"),
    (r"Expected `(?P<want>[^`]+)` < (?P<n>\S+?)(\.0)?", "must be {want} below {n}"),
    (r"Object missing required field `(?P<n>.+)`", "{n} is missing"),
    (r"Object contains unknown field `(?P<n>.+)`", "there is no {n} here"),
    (r"Invalid enum value (?P<n>.+)", "{n} is not known"),
)
_TABLE = tuple((re.compile(pattern, re.DOTALL), words) for pattern, words in _PATTERNS)


def plainly(error: Exception) -> str:
    """Return it as `ttl_s must be a number, not text`; what is not in the table stays as it is."""
    what, key = _parts(error)
    found = _known(what)
    if found is None:
        return f"{key}: {what[:1].lower()}{what[1:]}" if key else what
    return f"{key} {found}" if key else found


def said(error: Exception) -> str:
    """Return the same without its key."""
    what, _key = _parts(error)
    return _known(what) or what[:1].lower() + what[1:]


def key_of(error: Exception) -> str:
    """Return the path of the key, as `rules[0].above`; empty for the whole."""
    return _parts(error)[1]


def _known(what: str) -> str | None:
    return next((_said(words, found) for one, words in _TABLE if (found := one.fullmatch(what))), None)


def _parts(error: Exception) -> tuple[str, str]:
    what, at, where = str(error).rpartition(" - at `$")  # a name may have anything in it
    return (what, where.strip("`").removeprefix(".")) if at else (str(error), "")


def _said(words: str, found: "re.Match[str]") -> str:
    kinds = {
        key: _kinds(value) if key in ("want", "got") else value for key, value in found.groupdict().items()
    }
    return words.format(**kinds)


def _kinds(kinds: str) -> str:
    """`int | float` is a number; nothing that can be left out is named."""
    named = [one for one in kinds.split(" | ") if one != "null"] or ["null"]
    if "float" in named and "int" in named:
        named.remove("int")
    return " or ".join(_KINDS.get(one, one) for one in named)
