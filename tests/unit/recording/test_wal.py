"""A bit that flips in the spool's write-ahead log: what SQLite then leaves out in silence is told."""

import contextlib
import os
import random
import signal
import sqlite3
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
LOG, INDEX = "00000001.db-wal", "00000001.db-shm"


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
            time.sleep(600)  # until it is killed
    assert os.read(reader, 1) == b"!"
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return folder


@pytest.fixture
def spool(left: Path, tmp_path: Path) -> Path:
    folder = tmp_path / "spool"
    folder.mkdir(mode=0o700)
    for file in left.iterdir():
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


def test_a_file_that_calls_itself_read_only_beside_a_damaged_log_keeps_no_spool_closed(
    spool: Path, folder_url: str
) -> None:
    """One flipped bit of the database's format (sqlite.org/fileformat, 1.3.3), and one of its log."""
    database = spool / "00000001.db"
    content = bytearray(database.read_bytes())
    content[18] = 0x42  # in the log there is no first page, so this one counts
    database.write_bytes(content)
    flip(spool / LOG, frames(spool / LOG)[0][0] + FRAME.size)
    assert {file.name for file in sent(spool, Store(folder_url))} == {
        "00000001.damaged.db",
        "00000001.cut.db",
    }


def test_what_was_being_written_when_the_power_went_is_no_alarm(spool: Path) -> None:
    known = frames(spool / LOG)
    content = (spool / LOG).read_bytes()
    (spool / LOG).write_bytes(content[: known[-1][0] + 100])
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0
    (spool / LOG).write_bytes(content + bytes(2 * FRAME_BYTES))
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0


@pytest.mark.parametrize("index", ["gone", "empty", "as it was a commit before"])
def test_a_commit_that_the_power_cut_has_torn_is_no_alarm(
    spool: Path, tmp_path: Path, folder_url: str, index: str
) -> None:
    """Sectors of it may be there and others not, whatever their order."""
    known = frames(spool / LOG)
    before = max(begin for begin, is_commit in known[:-1] if is_commit) + FRAME_BYTES
    content = bytearray((spool / LOG).read_bytes())
    if index == "gone":
        (spool / INDEX).unlink()
    elif index == "empty":
        (spool / INDEX).write_bytes(bytes(len((spool / INDEX).read_bytes())))
    else:
        (spool / INDEX).write_bytes(indexed(spool, bytes(content[:before]), tmp_path))
    content[before + FRAME.size : before + FRAME.size + PAGE_BYTES // 2] = bytes(PAGE_BYTES // 2)
    (spool / LOG).write_bytes(content)
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0
    store = Store(folder_url)
    assert sent(spool, store) == []
    assert list(verify.batches_missing(store, spool)) == []
    assert store.dataset(HERE).count_rows() == COMMITS - 1


def indexed(spool: Path, log: bytes, folder: Path) -> bytes:
    """The index that SQLite makes of this log."""
    copy = folder / "copy.db"
    copy.write_bytes((spool / LOG.removesuffix("-wal")).read_bytes())
    copy.with_name("copy.db-wal").write_bytes(log)
    with contextlib.closing(sqlite3.connect(copy)) as database:
        database.execute("SELECT count(*) FROM run").fetchone()
        return copy.with_name("copy.db-shm").read_bytes()


def test_frames_of_a_log_that_was_brought_home_are_no_alarm(spool: Path) -> None:
    known = frames(spool / LOG)
    content = bytearray((spool / LOG).read_bytes())
    for begin, _ in known[len(known) // 2 :]:
        FRAME.pack_into(content, begin, *FRAME.unpack_from(content, begin)[:2], 1, 2, 3, 4)
    (spool / LOG).write_bytes(content)
    assert lost_commits(spool / LOG, PAGE_BYTES) == 0
