"""Witnesses of a journal: heads that the robot signed and others keep, and their comparison with it.

A chain that was rewritten whole holds in itself. Only who has seen another one can tell.
"""

import base64
import binascii
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from enum import StrEnum
from pathlib import Path
from typing import Final

from gateway import signatures
from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.records.chain import Broken
from gateway.records.reading import verified
from gateway.records.signing import message
from gateway.wire.control import SignedHead


class WitnessVerdict(StrEnum):
    """Result of checking a journal."""

    INTACT = "intact"  # every entry is the one that a witness has seen
    BROKEN = "broken"
    UNPROVEN = "unproven"  # it holds in itself, and nobody else has seen all of it


@dataclass(frozen=True, slots=True)
class Judgement:
    """Result for a journal; `at` is the first wrong or unproven entry."""

    verdict: WitnessVerdict
    text: str
    at: int | None = None
    entries: int = 0
    removed: int = 0  # entries before the first, as the journal itself says
    witnessed: int = 0  # up to here others have seen it


NOBODY: Final = "nobody else has seen it: name what a desk has kept with --witness"


def objection(head: SignedHead, key: str | None) -> str | None:
    """Return why this proves nothing about the robot whose key has this fingerprint, else `None`.

    Raises:
        KeyProblem: nobody can say, because there is no program to do it.

    """
    what = f"what is said to be signed for entry {head.n}"
    try:
        der = der_of(head.certificate.encode("ascii", "replace"))
        signature = base64.b64decode(head.signature, validate=True)
    except (KeyProblem, binascii.Error, ValueError) as error:
        return f"{what} is damaged: {error}"
    found = fingerprint(der)
    if key is None:
        return f"whether {found[:16]}… is this robot's key is not known here: say --key"
    if found != key.lower():
        return f"{what} is of another robot, or another key: {found[:16]}…, not {key.lower()[:16]}…"
    return None if signatures.holds(der, message(head), signature) else f"{what}: its signature does not hold"


def judge(journal: Path, witnesses: Iterable[SignedHead], problem: str = NOBODY) -> Judgement:
    """Return the verdict of the valid witnesses on a journal; `problem` says why there are none.

    Raises:
        OSError: it cannot be read.

    """
    seen = sorted(witnesses, key=lambda head: head.n)
    wanted = {head.n for head in seen}
    hashes: dict[int, str] = {}
    first = last = 0
    try:
        for entry in verified(journal):
            last = entry["n"]
            if not first:
                first = last
                hashes[first - 1] = entry["previous"]
            if last in wanted:
                hashes[last] = entry["hash"]
    except Broken as error:
        return Judgement(WitnessVerdict.BROKEN, str(error), error.at)
    found = Judgement(
        WitnessVerdict.UNPROVEN, problem, first or 1, last - first + 1 if first else 0, max(0, first - 1)
    )
    return _told(found, seen, hashes, last)


def _told(found: Judgement, seen: list[SignedHead], hashes: Mapping[int, str], last: int) -> Judgement:
    counts = found.entries, found.removed
    good: SignedHead | None = None
    for head in seen:
        if head.n > last:
            text = f"{_when(head)} it had {head.n} entries, and now it ends with {last}: the others are gone"
            return Judgement(WitnessVerdict.BROKEN, text, last + 1, *counts, good.n if good else 0)
        if head.n in hashes and hashes[head.n] != head.hash:
            since = f"entries up to {good.n} are as they were" if good else "no earlier entry was witnessed"
            text = f"{_when(head)} entry {head.n} was another one: the journal was rewritten; {since}"
            return Judgement(WitnessVerdict.BROKEN, text, head.n, *counts, good.n if good else 0)
        good = head if head.n in hashes else good
    if good is None and seen:
        text = f"what others have seen of it ends with entry {seen[-1].n}, which is removed"
        return Judgement(WitnessVerdict.UNPROVEN, text, found.at, *counts)
    if good is None:
        return found
    if good.n < last:
        text = f"entries up to {good.n} are as they were {_when(good)}; nobody has seen those after it"
        return Judgement(WitnessVerdict.UNPROVEN, text, good.n + 1, *counts, good.n)
    return Judgement(WitnessVerdict.INTACT, f"as it was {_when(good)}", None, *counts, good.n)


def _when(head: SignedHead) -> str:
    instant = datetime.fromtimestamp(head.utc_ns / 1e9, UTC)
    return f"on {instant:%Y-%m-%d %H:%M:%S} UTC by the robot's clock"
