"""Names for a device's objects that a person can type: made of what the EDS calls them."""

import re
import unicodedata
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from canopen.objectdictionary import ODVariable

_IN_BRACKETS = re.compile(r"\([^)]*\)")
_LAST_BRACKETS = re.compile(r"\(([^)]*)\)\s*$")
_NO_NAME = re.compile(r"[^a-z0-9]+")


def identifier(text: str) -> str:
    """`Profile velocity (counts/s)` → `profile_velocity`; empty where no letter or digit is left."""
    plain = unicodedata.normalize("NFKD", _IN_BRACKETS.sub("", text)).encode("ascii", "ignore").decode()
    return _NO_NAME.sub("_", plain.lower()).strip("_")


def remark(text: str) -> str:
    """Return the text in brackets at the end of a name, often its unit: `Profile velocity (counts/s)`."""
    found = _LAST_BRACKETS.search(text)
    return found[1].strip() if found else ""


def object_name(variable: "ODVariable") -> str:
    """Return an object's own name.

    A sub-object's stands behind its object's, unless it begins with it anyway.
    """
    own = identifier(variable.name)
    whole = identifier(variable.qualname.removesuffix(f".{variable.name}"))
    if variable.qualname == variable.name or own.startswith(whole):
        return own
    return f"{whole}_{own}".strip("_")
