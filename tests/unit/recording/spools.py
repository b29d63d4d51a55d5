"""A spool whose disk hangs or refuses, and what was kept in a spool."""

import threading
from collections.abc import Sequence
from pathlib import Path

from server_gui.core.recording.errors import SpoolUnusable
from server_gui.core.recording.rows import Record, Run
from server_gui.core.recording.spool import Spool
from tests.support.waiting import WAIT_S


def kept(spool: Spool) -> tuple[list[Run], list[Record]]:
    """Everything in the frozen segments."""
    runs: list[Run] = []
    records: list[Record] = []
    for number in spool.waiting():
        segment = spool.read(number)
        runs += segment.runs()
        records += segment.records()
        segment.close()
    return runs, records


def rows(runs: Sequence[Run]) -> list[tuple[str, str, int, int, int]]:
    return [
        (run.robot, run.connection, run.stream, int(seq), int(row))
        for run in runs
        for seq, row in zip(run.seqs, run.rows, strict=True)
    ]


def events(spool: Spool, *kinds: str) -> list[dict[str, object]]:
    return [
        record.fields
        for record in kept(spool)[1]
        if record.table == "events" and record.fields["kind"] in kinds
    ]


class StuckSpool(Spool):
    """A spool whose disk answers only when it is let go, or refuses."""

    def __init__(self, folder: Path) -> None:
        self.let_go = threading.Event()
        self.reached = threading.Event()
        self.refusals = 0
        super().__init__(folder, reserve_bytes=0)

    def append(self, *args: object, **more: object) -> None:
        self.reached.set()
        self.let_go.wait(WAIT_S)
        if self.refusals:
            self.refusals -= 1
            raise SpoolUnusable("the disk refuses")
        super().append(*args, **more)  # type: ignore[arg-type]
