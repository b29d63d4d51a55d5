"""`python -m tests.scenario.recording_lives SPOOL URL LIVES SEED`: a recording, killed again and again.

Each life is a fork of this process with a recorder and an uploader at work, ended by SIGKILL at a random
moment. What was acknowledged is printed, a number a line; each number was recorded as a value of its own.
"""

import os
import random
import signal
import sys
import time
from pathlib import Path

from ml.store import Store
from server_gui.core.recording.recorder import Recorder, RecorderSettings
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import batch

ROBOT = "exo-01"
PER_LIFE = 1_000_000  # numbers that a life may use
LONGEST_S = 0.3
UPLOADED = b"uploaded\n"
AWAITED = (b"", b"\n", UPLOADED)  # what a life must have told: nothing, that it records, that it uploads
SETTINGS = RecorderSettings(batch_s=0.02)


def live(spool: Path, url: str, first: int, told: int) -> None:
    """Record one number after another, and tell each that is acknowledged, until we are killed."""
    with (
        Spool(spool, reserve_bytes=0) as opened,
        Uploader(opened, lambda: Store(url)) as uploader,
        Recorder(opened, settings=SETTINGS) as recorder,
    ):
        for number in range(first, first + PER_LIFE):
            recorder.record(ROBOT, 1, batch(number, channels=("counter.number",)))
            if number % 5 == 4 and recorder.flush(WAIT_S):
                os.write(told, f"{number}\n".encode())  # this and every one before it in this life
                uploader.now()
            if uploader.state.uploaded:
                os.write(told, UPLOADED)


def end(spool: Path, url: str, life: int, chance: random.Random) -> bytes:
    """One life, ended at a random moment after it has come as far as its turn says; all that it told."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        live(spool, url, life * PER_LIFE, writer)
        os._exit(1)
    os.close(writer)
    told, awaited = b"", AWAITED[life % len(AWAITED)]
    while awaited not in told:
        told += os.read(reader, 65_536)
    time.sleep(chance.uniform(0, LONGEST_S))  # the moment of the kill, not a synchronisation
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    while more := os.read(reader, 65_536):
        told += more
    os.close(reader)
    return told.replace(UPLOADED, b"")


def main() -> int:
    """Run the lives one after another."""
    spool, url, lives, seed = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
    chance = random.Random(seed)
    for life in range(lives):
        os.write(sys.stdout.fileno(), end(spool, url, life, chance))
    return 0


if __name__ == "__main__":
    sys.exit(main())
