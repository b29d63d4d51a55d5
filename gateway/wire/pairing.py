"""Pairing: what desk and robot say once, over TLS, to know each other's keys from then on. Pure.

A code of 80 bits is read from the robot's screen and typed at the desk. Each proves to know it, bound to both
certificates as that side sees them: whoever is in between has another one, and cannot make up the proof.
"""

import hmac
import re
import secrets
from typing import Final

from msgspec import Struct

PAIRING_PORT: Final = 7421
VALID_S: Final = 300.0
TRIES: Final = 5
SAY_S: Final = 5.0  # how long one side may take for its handshake and its line
LINE_BYTES: Final = 8192
_SIGNS: Final = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"  # Crockford's base 32: no I, L, O, U
_LENGTH: Final = 16  # of them, five bits each
# In groups, as it is shown; in one, where it has a digit: a host is rarely called so.
_CODE: Final = (
    r"(?<![0-9A-Z])(?:[0-9A-Z]{4}([- ])(?:[0-9A-Z]{4}\1){2}[0-9A-Z]{4}"
    r"|(?=[A-Z]*[0-9])[0-9A-Z]{16})(?![0-9A-Z.])"
)
_MISREAD: Final = str.maketrans("ILO", "110")
ROBOT, DESK = "robot", "desk"  # whose proof it is
SCHEME: Final = "gwrms://"


class Offer(Struct, frozen=True, forbid_unknown_fields=True):
    """The desk's message: its certificate (PEM), its proposed name, and its proof."""

    certificate: str
    name: str
    proof: str


class Reply(Struct, frozen=True):
    """The robot's answer; `problem` if pairing failed."""

    proof: str = ""
    robot: str = ""
    port: int = 0  # of its gateway
    name: str = ""  # of the desk, from now on
    role: str = ""
    problem: str | None = None


def new_code() -> str:
    """Return a code that nobody guesses, as people read it."""
    signs = "".join(secrets.choice(_SIGNS) for _ in range(_LENGTH))
    return "-".join(signs[at : at + 4] for at in range(0, _LENGTH, 4))


def normal(code: str) -> str:
    """Return a code as it was typed, with what is easily misread; raises `ValueError` where it is none."""
    signs = code.upper().translate(_MISREAD).replace("-", "").replace(" ", "")
    if len(signs) != _LENGTH or not set(signs) <= set(_SIGNS):
        raise ValueError(f"a code has {_LENGTH} letters and digits, as the robot shows them")
    return signs


def link(where: str, code: str) -> str:
    """Return a robot's pairing address and its code in one, as in its QR code."""
    return f"{SCHEME}{where}/{code}"


def is_link(text: str) -> bool:
    """Return whether a text is meant as such a link; some readers of QR codes write capitals."""
    return text.strip().lower().startswith(SCHEME)


def has_code(text: str) -> bool:
    """Return whether a text has what looks like a code, which is then shown to nobody."""
    is_path = text.lstrip().startswith(("/", ".", "~"))
    return not is_path and re.search(_CODE, text.upper()) is not None


def of_link(text: str) -> tuple[str, str]:
    """Return both again; raises `ValueError` where the text is no such link."""
    where, slash, code = text.strip()[len(SCHEME) :].partition("/")
    if not (is_link(text) and where and slash):
        raise ValueError(f"a robot's link is {SCHEME}HOST:PORT/CODE, as it shows it")
    return where, normal(code)


def proof(whose: str, code: str, robot: str, desk: str) -> str:
    """Return the proof that `whose` side knows the code, bound to both fingerprints."""
    message = f"gwrms pair 1 {whose} {robot} {desk}".encode("ascii")
    return hmac.new(normal(code).encode("ascii"), message, "sha256").hexdigest()


def proves(given: str, whose: str, code: str, robot: str, desk: str) -> bool:
    """Return whether a proof is right, in a time that tells nothing of it."""
    expected = proof(whose, code, robot, desk)
    return hmac.compare_digest(given.encode("utf-8", "replace"), expected.encode("ascii"))
