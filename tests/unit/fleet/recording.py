"""A fleet that records into a spool, and what it has kept in there."""

import contextlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from gateway.client import Address
from gateway.wire.resource import ResourceSnapshotParams
from server_gui.core.fleet.fleet import Fleet
from server_gui.core.follow.events import Event
from server_gui.core.follow.feed import ONCE, FollowSettings
from server_gui.core.follow.network import Network
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.rows import Record, Run
from server_gui.core.recording.spool import Spool
from tests.support.waiting import until

FOLLOWING = FollowSettings(
    "test",
    channels=("*",),
    rate_hz=100.0,
    look_s=ONCE,
    resources=ResourceSnapshotParams(include=["kernel"]),
    resources_s=0.1,
    journal_s=0.1,
)


@dataclass
class Kept:
    """What a spool holds, once nobody records into it any more."""

    runs: list[Run] = field(default_factory=list)
    records: list[Record] = field(default_factory=list)

    @classmethod
    def of(cls, folder: Path) -> "Kept":
        kept = cls()
        with Spool(folder, reserve_bytes=0) as spool:
            for number in spool.waiting():
                segment = spool.read(number)
                kept.runs += segment.runs()
                kept.records += segment.records()
                segment.close()
        return kept

    def rows(self, robot: str) -> list[tuple[str, int, int, int]]:
        """Connection, stream, seq and row, of every row."""
        return [
            (run.connection, run.stream, int(seq), int(row))
            for run in self.runs
            if run.robot == robot
            for seq, row in zip(run.seqs, run.rows, strict=True)
        ]

    def table(self, name: str, robot: str) -> list[dict[str, Any]]:
        """The rows of another table that are the robot's."""
        fields = (record.fields for record in self.records if record.table == name)
        return [found for found in fields if found["robot"] == robot]

    def events(self, robot: str) -> list[tuple[str, dict[str, Any]]]:
        """Kind and data of the robot's events."""
        return [(found["kind"], json.loads(found["data"])) for found in self.table("events", robot)]

    def is_whole(self, robot: str) -> bool:
        """Whether no notification of any connection is missing, and no row there twice."""
        rows = self.rows(robot)
        streams: dict[tuple[str, int], set[int]] = {}
        for connection, stream, seq, _ in rows:
            streams.setdefault((connection, stream), set()).add(seq)
        whole = all(seqs == set(range(min(seqs), max(seqs) + 1)) for seqs in streams.values())
        return bool(rows) and whole and len(rows) == len(set(rows))


class Recording:
    """A fleet at work."""

    def __init__(self, fleet: Fleet, recorder: Recorder, shown: Sequence[tuple[str, Event]]) -> None:
        self.fleet = fleet
        self.recorder = recorder
        self.shown = shown

    def rows(self, robot: str) -> int:
        return self.fleet.report()[robot].rows

    def until(self, condition: Callable[[], object]) -> None:
        until(condition, self.fleet.report)

    def until_more(self, *robots: str) -> None:
        """Wait until each has sent something that is not there yet."""
        before = {robot: self.rows(robot) for robot in robots}
        self.until(lambda: all(self.rows(robot) > before[robot] + 5 for robot in robots))


@contextlib.contextmanager
def recording(
    folder: Path, robots: Mapping[str, str], following: FollowSettings = FOLLOWING, **facts: Any
) -> Iterator[Recording]:
    """Follow these robots (name → address) and record them into `folder`."""
    shown: list[tuple[str, Event]] = []
    addresses = {name: Address.parse(address) for name, address in robots.items()}
    with Spool(folder, reserve_bytes=0) as spool, Recorder(spool) as recorder, Network() as network:
        fleet = Fleet(following, recorder, **facts)
        fleet.subscribers.append(lambda robot, event: shown.append((robot, event)))
        for name, address in addresses.items():
            fleet.follow(name, address)
        following_all = network.run(fleet.run())
        yield Recording(fleet, recorder, shown)
        assert not following_all.done(), following_all.result()
