"""Certificates as they are read, compared and named; whoever has one is known by its SHA-256."""

import base64
import binascii
import hashlib
import re
from typing import Final

# Each of its parts can be read in one way only: whoever sends it has no work made of it.
_PEM: Final = re.compile(rb"-----BEGIN CERTIFICATE-----(\s[A-Za-z0-9+/=\s]*+)-----END CERTIFICATE-----")
NAME: Final = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")  # of a key's owner, and of its file


class KeyProblem(Exception):
    """A key or certificate cannot be made or read; says what to do, and never what is in it."""


def fingerprint(der: bytes) -> str:
    """Return a certificate's SHA-256, as it is compared."""
    return hashlib.sha256(der).hexdigest()


def grouped(fingerprint: str) -> str:
    """Return the same for people: eight signs a group."""
    return " ".join(fingerprint[at : at + 8] for at in range(0, len(fingerprint), 8))


def der_of(pem: bytes) -> bytes:
    """Return the one certificate of a PEM text.

    Raises:
        KeyProblem: it holds none, or more than one.

    """
    found = _PEM.findall(pem)
    if len(found) != 1:
        raise KeyProblem(f"{len(found)} certificates are in it; there should be one")
    try:
        return binascii.a2b_base64(found[0])
    except binascii.Error as error:
        raise KeyProblem(f"it is no certificate: {error}") from error


def pem_of(der: bytes) -> bytes:
    """Return it as it stands in a file."""
    text = base64.b64encode(der).decode("ascii")
    lines = (text[at : at + 64] for at in range(0, len(text), 64))
    return "\n".join(["-----BEGIN CERTIFICATE-----", *lines, "-----END CERTIFICATE-----", ""]).encode("ascii")
