"""A bit that flips in the spool's write-ahead log: what SQLite then leaves out in silence is told."""

import os
import random
import signal
import time
from pathlib import Path

import msgspec
import pytest

from ml.store import Store, reading
from ml.store.tables import TELEMETRY
from server_gui.core.cloud import verify
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.segment import PAGE_BYTES
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.recording.wal import FRAME, HEADER, lost_commits
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import batch

HERE = TELEMETRY.location("exo-01", 1)
COMMITS, FRAME_BYTES = 30, FRAME.size + PAGE_BYTES
LOG = "00000001.db-wal"


@pytest.fixture(scope="module")
def left(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The spool of a server that was killed after so many commits, each of one row."""
    folder = tmp_path_factory.mktemp("left") / "spool"
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        spool = Spool(folder, reserve_bytes=0)
        with Recorder(spool) as recorder:
            for seq in range(COMMITS):
                recorder.record("exo-01", 1, batch(seq))
                recorder.flush(WAIT_S)
            os.write(writer, b"!")
            time.sleep(600)
    assert os.read(reader, 1) == b"!"
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return folder


@pytest.fixture
def spool(left: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "spool"
    folder.mkdir(mode=0o700)
    for file in left.iterdir():
        if not file.name.endswith("-shm"):
            (folder / file.name).write_bytes(file.read_bytes())
    return folder


def flip(log: Path, at: int) -> None:
    content = bytearray(log.read_bytes())
    content[at] ^= 1 << random.Random(at).randrange(8)
    log.write_bytes(content)


def frames(log: Path) -> list[tuple[int, bool]]:
    """Where each frame begins, and whether it ends a commit."""
    content = log.read_bytes()
    begins = range(HEADER.size, len(content), FRAME_BYTES)
    return [(begin, FRAME.unpack_from(content, begin)[1] > 0) for begin in begins]


def sent(spool: Path, store: Store) -> list[Path]:
    """What was set aside while all of it went to the store."""
    with Spool(spool, reserve_bytes=0) as opened:
        for number in opened.waiting():
            send(opened, number, store)
        return opened.damaged()


def test_a_log_that_is_whole_is_no_alarm(spool: Path, folder_url: str) -> None:
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0
    store = Store(folder_url)
    assert sent(spool, store) == []
    assert store.dataset(HERE).count_rows() == COMMITS


@pytest.mark.parametrize("place", ["page", "its sum", "its salt", "its number"])
@pytest.mark.parametrize("share", [0.2, 0.5, 0.97])
def test_commits_behind_a_flipped_bit_are_a_loss_that_is_told(
    spool: Path, folder_url: str, share: float, place: str
) -> None:
    at = {"its number": 3, "its salt": 9, "its sum": 18, "page": FRAME.size + PAGE_BYTES // 2}[place]
    known = frames(spool / LOG)
    begin = known[int(len(known) * share)][0]
    behind = sum(is_commit for where, is_commit in known if where >= begin)
    flip(spool / LOG, begin + at)
    before = (spool / LOG).read_bytes()
    store = Store(folder_url)
    assert [file.name for file in sent(spool, store)] == ["00000001.cut.db"]
    assert (spool / "00000001.cut.db-wal").read_bytes() == before
    assert sent(spool, store) == [spool / "00000001.cut.db"]  # it stays, and is told once
    [event] = [row for row in store.dataset("events").to_table().to_pylist() if row["kind"] == "lost"]
    assert msgspec.json.decode(event["data"]) == {"commits": behind}
    assert COMMITS - behind <= reading.dataset(store, TELEMETRY).count_rows() < COMMITS
    [problem] = verify.batches_missing(store, spool)
    assert f"00000001.cut.db was set aside: up to {behind} commits" in problem


@pytest.mark.parametrize("at", [1, 9, 17, 25])
def test_a_damaged_header_is_told_with_all_that_it_hides(spool: Path, folder_url: str, at: int) -> None:
    commits = sum(is_commit for _, is_commit in frames(spool / LOG))
    flip(spool / LOG, at)
    assert lost_commits(spool / LOG, PAGE_BYTES) == commits


def test_what_was_being_written_when_the_power_went_is_no_alarm(spool: Path) -> None:
    known = frames(spool / LOG)
    content = (spool / LOG).read_bytes()
    (spool / LOG).write_bytes(content[: known[-1][0] + 100])
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0
    (spool / LOG).write_bytes(content + bytes(2 * FRAME_BYTES))
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0


def test_frames_of_a_log_that_was_brought_home_are_no_alarm(spool: Path) -> None:
    known = frames(spool / LOG)
    content = bytearray((spool / LOG).read_bytes())
    for begin, _ in known[len(known) // 2 :]:
        FRAME.pack_into(content, begin, *FRAME.unpack_from(content, begin)[:2], 1, 2, 3, 4)
    (spool / LOG).write_bytes(content)
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0
