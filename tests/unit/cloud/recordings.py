"""Small recordings in a store, as a server makes them, for tests of what looks into it."""

import time
from dataclasses import dataclass
from pathlib import Path

from ml.store import Store
from ml.store.labels import Label
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts, label
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.recording.robots import CHANNELS, batch, description

PARAMETERS: dict[str, float | int | None] = {"gain": 2.0, "step": 1.0000020756226495}
BATCHES, ROWS = 20, 5
UNITS = {"left_knee.position": "rad", "left_knee.velocity": "rad/s", "trunk.tilt_forward": "rad"}


@dataclass(frozen=True)
class Recorded:
    """A store with a session, and the spool that it came from."""

    store: Store
    spool: Path
    session: str
    robot: str


def record(
    url: str, spool: Path, robot: str = "exo-01", *, sent: bool = True, channels: tuple[str, ...] = CHANNELS
) -> Recorded:
    """A session of `BATCHES` × `ROWS` rows, a gap, a marker and a label; `sent` to the store, or waiting."""
    with Spool(spool, reserve_bytes=0) as opened:
        with Recorder(opened) as recorder:
            recorder.describe(robot, description(robot))
            session = recorder.begin(
                robot,
                Facts(operator="anna", notes="first", parameters=PARAMETERS),
            )
            for seq in range(BATCHES):
                recorder.record(robot, 1, batch(seq + (seq >= 10), ROWS, channels=channels))
            recorder.mark(robot, "here")
            now_ns = time.time_ns()
            recorder.add(label(Label(robot, session, now_ns - 10**9, now_ns, "walk", "anna")))
        store = Store(url)
        for number in opened.waiting() if sent else ():
            send(opened, number, store)
    return Recorded(store, spool, session, robot)
