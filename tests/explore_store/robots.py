"""Robots as a server sees them: boots, links, numbers, units, a journal."""

from dataclasses import dataclass, field
from typing import Any

import msgspec

from gateway.client import Batch
from gateway.wire.messages import Description

COUNT, ANGLE = "x.count", "knee.angle"
EVERY_NS = 10_000_000  # between rows
STREAM = 1
TAIL = 6  # entries of its journal that a robot gives


@dataclass(slots=True)
class Robot:
    """One machine; `unit` is what it means by its angle."""

    name: str
    unit: str | None
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
        channels = [
            {"name": COUNT, "unit": None, "component": "x", "quantity": "count"},
            {"name": ANGLE, "unit": self.unit, "component": "knee", "quantity": "angle"},
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
    """A server's link to a robot."""

    robot: Robot
    number: int = 0
    seq: int = 0

    def again(self) -> None:
        self.number, self.seq = self.number + 1, 0

    def batch(
        self, counts: list[int], angles: list[float | None], stamps_ns: list[int], now_ns: int
    ) -> Batch:
        found = Batch(
            stamps_ns, {COUNT: [*map(float, counts)], ANGLE: angles}, self.seq, 0, 0, self.number, now_ns
        )
        self.seq += 1
        return found
