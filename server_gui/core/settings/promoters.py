"""Signatures of promotions: a desk signs its promotions, and stop rules accept trusted desks only."""

import base64
from collections.abc import Mapping
from typing import Final

from gateway import signatures
from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.client.keys import CERTIFICATE, KEY, keys_folder
from gateway.client.pairing import own_certificate, own_name
from ml.registry.card import Card, digest
from ml.registry.pointers import Pointer, Sign

UNSIGNED: Final = "unsigned"


def desk_signature() -> Sign | None:
    """Return the function that signs with this desk's key; `None` without a key."""
    folder = keys_folder()
    if not ((folder / KEY).exists() and (folder / CERTIFICATE).exists()):
        return None

    def sign(message: bytes) -> tuple[str, str]:
        certificate = own_certificate().decode("ascii")
        return certificate, base64.b64encode(signatures.sign(folder / KEY, message)).decode("ascii")

    return sign


def own_line() -> tuple[str, str]:
    """Name and fingerprint of this desk, for `[promoters]`; raises `KeyProblem` where it can have no key."""
    certificate = own_certificate()
    return own_name(), fingerprint(der_of(certificate))


def objection(
    pointer: Pointer | None, task: str, robot: str, card: Card, known: Mapping[str, str]
) -> str | None:
    """Return why no rule may stop a robot by what serves; `None` if one of these promoted this very model.

    `known` are the fingerprints of their keys by name, `robot` is "" where it serves every robot.
    """
    if pointer is None:
        return f"{card.id} is {UNSIGNED}: it came with GWRMS, and nobody has promoted it"
    if not pointer.signature:
        return f"{card.id} is {UNSIGNED}: {pointer.who} had no key when it was promoted"
    try:
        by = fingerprint(der_of(pointer.certificate.encode("ascii", "replace")))
        if by not in known.values():
            return f"{card.id} was promoted with the key {by[:16]}…, which is none of [promoters]"
        return _unsound(pointer, task, robot, card)
    except (KeyProblem, ValueError) as error:
        return f"who has promoted {card.id} cannot be told: {error}"


def signer(pointer: Pointer, task: str, robot: str, card: Card, known: Mapping[str, str]) -> str:
    """Return the signer of a promotion, for people; an invalid signature counts as none."""
    if not pointer.signature:
        return UNSIGNED
    try:
        by = fingerprint(der_of(pointer.certificate.encode("ascii", "replace")))
        problem = _unsound(pointer, task, robot, card)
    except (KeyProblem, ValueError) as error:
        problem = str(error)
    if problem is not None:
        return f"{UNSIGNED}: {problem}"
    return next((f"signed by {name}" for name, key in known.items() if key == by), f"signed by {by}")


def _unsound(pointer: Pointer, task: str, robot: str, card: Card) -> str | None:
    if pointer.model != card.id or pointer.content != digest(card):
        return f"{card.id} is not the model that was signed"
    der = der_of(pointer.certificate.encode("ascii", "replace"))
    signature = base64.b64decode(pointer.signature, validate=True)
    if signatures.holds(der, pointer.message(task, robot), signature):
        return None
    return f"the signature of who promoted {card.id} does not hold"
