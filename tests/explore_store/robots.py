"""Robots as a server sees them: boots, links, numbers, units, a journal."""

from dataclasses import dataclass, field
from typing import Any

import msgspec

from gateway.client import Batch
from gateway.wire.robot import Description

COUNT, ANGLE, RATIO = "x.count", "knee.angle", "drive.load"
NO_DIMENSION = ""  # the unit of the last one
EVERY_NS = 10_000_000  # between rows
STREAM, SECOND = 1, 2  # that has no angle
LATE_NS = 25_000_000  # that the second one comes
TAIL = 6  # entries of its journal that a robot gives


@dataclass(slots=True)
class Robot:
    """One machine; `unit` is what it means by its angle. Some nobody `can_be_asked` for their clock."""

    name: str
    unit: str | None
    can_be_asked: bool = True
    began_ns: int = 0  # its clock
    boots: int = 1
    called: str = ""
    journal: list[dict[str, Any]] = field(default_factory=list)

    def boot(self, now_ns: int) -> None:
        self.boots += 1
        self.began_ns = now_ns - 1_000_000_000

    def write(self) -> None:
        """An entry into its journal."""
        n = len(self.journal) + 1
        self.journal.append({"n": n, "hash": f"{self.name}-{n}", "who": "ada", "what": "note", "utc_ns": n})

    @property
    def description(self) -> Description:
        channels: list[dict[str, Any]] = [
            {"name": COUNT, "unit": None, "component": "x", "quantity": "count"},
            {"name": ANGLE, "unit": self.unit, "component": "knee", "quantity": "angle"},
            {"name": RATIO, "unit": NO_DIMENSION, "component": "drive", "quantity": "load"},
        ]
        found = {
            "robot": self.called or self.name,
            "boot_id": f"{self.name}-{self.boots}",
            "role": "observer",
            "components": [],
            "channels": [each for each in channels if each["unit"] is not None],
            "parameters": [],
            "modules": {},
            "clock": {"monotonic_ns": 1, "utc_ns": 2, "boot_id": f"{self.name}-{self.boots}"},
            "stop": {"held": False, "reason": None, "since_ns": None, "stopped_again": {}, "drives": {}},
            "guard": {},
        }
        return msgspec.convert(found, Description)


@dataclass(slots=True)
class Link:
    """A server's link to a robot; `seqs` are the next numbers of its streams."""

    robot: Robot
    number: int = 0
    seqs: dict[int, int] = field(default_factory=dict)
    begun: set[int] = field(default_factory=set)  # streams of which something has come

    def again(self) -> None:
        self.number, self.seqs, self.begun = self.number + 1, {}, set()

    def batch(
        self, stream: int, stamps_ns: list[int], columns: dict[str, list[float | None]], now_ns: int
    ) -> Batch:
        """The next one of the stream. What was missed before the first one the client has counted."""
        seq = self.seqs.setdefault(stream, 0)
        missed = 0 if stream in self.begun else seq
        self.seqs[stream] += 1
        self.begun.add(stream)
        return Batch(stamps_ns, columns, seq, 0, missed, self.number, now_ns)

    def miss(self, stream: int, count: int) -> None:
        """So many notifications never come."""
        self.seqs[stream] = self.seqs.get(stream, 0) + count
