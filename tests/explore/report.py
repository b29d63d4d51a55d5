"""What was found: kept as lines of a file, told shortest first, and made shorter where that can be."""

import os
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Self

import msgspec

from tests.explore.can import Sent
from tests.explore.invariants import KNOWN
from tests.explore.player import Order, written
from tests.explore.runtime import START_NS
from tests.explore.stage import Finding

FRAMES = 60


class Found(msgspec.Struct, frozen=True):
    """One violation, and the order of events that led there."""

    invariant: str
    text: str
    scene: str
    order: Order
    frames: list[str]
    after_s: float = 0.0  # so long after the search began

    @classmethod
    def of(
        cls, scene: str, order: Order, finding: Finding, frames: Sequence[Sent], after_s: float = 0.0
    ) -> Self:
        told = [_frame(one) for one in frames[-FRAMES:]]
        return cls(finding.invariant, finding.text, scene, order, told, after_s)

    @property
    def kind(self) -> tuple[str, str]:
        """What makes it another than the others."""
        return self.invariant, re.sub(r"\d+(\.\d+)?", "#", self.text)

    @property
    def length(self) -> tuple[int, int]:
        return len(self.order), sum(gap for gap, _ in self.order)

    def words(self) -> str:
        return "\n".join(
            [
                f"VIOLATED: {KNOWN.sentence(self.invariant)} [{self.invariant}]",
                f"  {self.text}",
                f"  --replay {written(self.scene, self.order)!r}",
            ]
        )


def note(file: Path, found: Found) -> None:
    """Add it; many processes write the same file."""
    line = msgspec.json.encode(found) + b"\n"
    descriptor = os.open(file, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o600)
    try:
        os.write(descriptor, line)
    finally:
        os.close(descriptor)


def noted(file: Path) -> list[Found]:
    """The shortest of each kind, the shortest first."""
    if not file.exists():
        return []
    found = [msgspec.json.decode(line, type=Found) for line in file.read_bytes().splitlines()]
    return list(_shortest(found))


def _shortest(found: Iterable[Found]) -> Iterable[Found]:
    best: dict[tuple[str, str], Found] = {}
    for one in sorted(found, key=lambda one: one.length):
        best.setdefault(one.kind, one)
    return best.values()


def _frame(sent: Sent) -> str:
    at_s = (sent.stamp_ns - START_NS) / 1e9
    return f"{at_s:12.6f} {sent.bus:5} {sent.sender:9} {sent.can_id:03X} {sent.data.hex(' ')}"
