"""Batches that are lost as a whole, before anybody has uploaded them, are never taken for empty ones."""

import itertools
import shutil
from collections.abc import Callable
from pathlib import Path

import msgspec
import pytest

from gateway.main import main
from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.rows import Record
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.spool_files import Files, SegmentState
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import WAIT_S
from tests.unit.recording.robots import batch

HERE = TELEMETRY.location("exo-01", 1)


def recorded(folder: Path, batches: int = 3) -> None:
    """Batches that wait, each with a row of telemetry; the last one is empty, and is written next."""
    with Spool(folder, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        for seq in range(batches):
            recorder.record("exo-01", 1, batch(seq))
            recorder.cut(lambda: None)
            assert recorder.flush(WAIT_S)


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def truncated(file: Path) -> None:
    file.write_bytes(file.read_bytes()[:40_000])


def garbled(file: Path) -> None:
    file.write_bytes(b"x" * 10_000)


def without_rows(file: Path) -> None:
    """As an older version of this program has left one that was emptied."""
    recorded(file.parent / "other", 0)
    (file.parent / "other" / "00000001.db").replace(file)


DAMAGES = (emptied, truncated, garbled, Path.unlink)


def told(store: Store) -> list[tuple[str, int]]:
    """Of whom, and which batch, events say that it is lost."""
    events = store.dataset("events").to_table().to_pylist()
    return [
        (line["robot"], msgspec.json.decode(line["data"])["batch"])
        for line in events
        if line["kind"] == "lost"
    ]


@pytest.mark.parametrize(("damage", "number"), [*itertools.product(DAMAGES, (2, 3)), (emptied, 1)])
def test_a_batch_that_is_lost_while_it_waits_is_told_by_exit_status_event_and_verify(
    tmp_path: Path,
    folder_url: str,
    capsys: pytest.CaptureFixture[str],
    damage: Callable[[Path], object],
    number: int,
) -> None:
    spool = tmp_path / "spool"
    recorded(spool)
    damage(spool / f"{number:08}.db")
    config = tmp_path / "server.toml"
    config.write_text(f'[store]\nurl = "{folder_url}"\n[recorder]\nspool = "{spool}"\n')
    assert main(["cloud", "upload", "--config", str(config)]) == 1
    said = capsys.readouterr()
    assert f"{number:08}" in said.err or f"batch {number} of the spool" in said.err
    assert said.out.startswith(f"{len(list(spool.glob('*.uploaded.db')))} batches uploaded to")
    store = Store(folder_url)
    assert told(store) == [("exo-01", number)]
    assert store.dataset(HERE).count_rows() == 2
    assert main(["cloud", "verify", "--config", str(config)]) == 1
    assert main(["cloud", "upload", "--config", str(config)]) == 0  # it was told
    assert told(store) == [("exo-01", number)]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_batch_that_is_lost_while_a_collector_runs_is_an_alarm_and_an_event(
    tmp_path: Path, folder_url: str, damage: Callable[[Path], object]
) -> None:
    spool = tmp_path / "spool"
    recorded(spool)
    with Spool(spool, reserve_bytes=0) as opened:
        uploader = Uploader(opened, lambda: Store(folder_url))
        damage(spool / "00000002.db")
        assert uploader._empty(asked=True)
        assert uploader._empty(asked=True)
        state = uploader.state
    assert "00000002" in "".join(state.damaged) or "batch 2 of the spool" in "".join(state.lost)
    assert told(Store(folder_url)) == [("exo-01", 2)]
    assert Store(folder_url).dataset(HERE).count_rows() == 2


def test_a_batch_that_is_gone_behind_a_damaged_one_is_told_too(tmp_path: Path, folder_url: str) -> None:
    recorded(spool := tmp_path / "spool", 2)
    first, *_, last = sorted(spool.glob("*.db"))
    first.write_bytes(b"")  # so that it is set aside as soon as the spool is opened
    for gone in {*spool.glob("*.db")} - {first, last}:
        gone.unlink()
    with Spool(spool, reserve_bytes=0) as opened:
        assert opened.damaged()
        assert Uploader(opened, lambda: Store(folder_url))._empty(asked=True)
    assert sorted(number for _, number in told(Store(folder_url))) == [*range(1, int(last.stem))]


def test_the_oldest_batch_that_waits_is_missed_where_others_were_uploaded(
    tmp_path: Path, folder_url: str
) -> None:
    spool = tmp_path / "spool"
    recorded(spool)
    with Spool(spool, reserve_bytes=0) as opened:
        assert Uploader(opened, lambda: Store(folder_url))._empty(asked=True)
    recorded(spool)
    for file in [*spool.glob("*.uploaded.db"), *spool.glob("00000005.db")]:
        file.unlink()
    with Spool(spool, reserve_bytes=0) as opened:
        uploader = Uploader(opened, lambda: Store(folder_url))
        assert uploader._empty(asked=True)
        assert "batch 5 of the spool" in "".join(uploader.state.lost)
    assert told(Store(folder_url)) == [("exo-01", 5)]


@pytest.mark.parametrize("damage", DAMAGES)
def test_a_loss_under_a_number_whose_loss_was_told_before_a_roll_back_is_told_too(
    tmp_path: Path, folder_url: str, damage: Callable[[Path], object]
) -> None:
    spool, copy, store = tmp_path / "spool", tmp_path / "copy", Store(folder_url)

    def lose() -> None:
        recorded(spool)
        for _ in range(2):  # the second opening has nothing new to tell
            damage(spool / "00000005.db") if (spool / "00000005.db").exists() else None
            with Spool(spool, reserve_bytes=0) as opened:
                Uploader(opened, lambda: store)._empty(asked=True)

    recorded(spool)
    with Spool(spool, reserve_bytes=0) as opened:
        assert Uploader(opened, lambda: store)._empty(asked=True)
    shutil.copytree(spool, copy)
    lose()
    assert told(store) == [("exo-01", 5)]
    shutil.rmtree(spool)
    copy.rename(spool)
    lose()
    assert told(store) == [("exo-01", 5), ("exo-01", 5)]


@pytest.mark.parametrize("content", [b"", b"\xff\xfe"])
def test_a_damaged_name_of_a_loss_keeps_nothing_from_the_store(
    tmp_path: Path, folder_url: str, content: bytes
) -> None:
    recorded(tmp_path)
    (tmp_path / "00000002.db").unlink()
    (tmp_path / "00000002.lost").write_bytes(content)
    with Spool(tmp_path, reserve_bytes=0) as opened:
        uploader = Uploader(opened, lambda: Store(folder_url))
        assert uploader._empty(asked=True)
        assert opened.waiting() == []
    assert told(Store(folder_url)) == [("exo-01", 2)]


def test_a_batch_that_is_closed_while_somebody_looks_is_not_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with Spool(tmp_path, reserve_bytes=0) as spool:

        def another() -> None:
            spool.append([], [Record("events", {"robot": "exo-01"})])
            spool.freeze()

        own = Files.own

        def meanwhile(files: Files) -> list[tuple[int, SegmentState]]:
            found = own(files)
            monkeypatch.setattr(Files, "own", own)
            another()
            another()
            return found

        another()
        monkeypatch.setattr(Files, "own", meanwhile)
        assert spool.untold() == {}
        assert spool.waiting() == [1, 2, 3]


def test_a_closed_batch_without_rows_is_damaged(tmp_path: Path, folder_url: str) -> None:
    recorded(tmp_path)
    without_rows(tmp_path / "00000002.db")
    with Spool(tmp_path, reserve_bytes=0) as opened:
        uploader = Uploader(opened, lambda: Store(folder_url))
        assert uploader._empty(asked=True)
        assert [Path(file).name for file in uploader.state.damaged] == ["00000002.damaged.db"]


def test_the_newest_file_emptied_beside_its_log_is_damaged_and_its_log_is_kept(
    tmp_path: Path, folder_url: str
) -> None:
    left = Spool(tmp_path, reserve_bytes=0)
    recorder = Recorder(left)
    with recorder:
        recorder.record("exo-01", 1, batch(0))
        assert recorder.flush(WAIT_S)
        files = {each.name: each.read_bytes() for each in tmp_path.glob("00000001.db*")}
    left.close()
    for file in tmp_path.glob("*.db*"):
        file.unlink()
    for name, content in files.items():  # as a kill leaves them
        (tmp_path / name).write_bytes(content)
    emptied(tmp_path / "00000001.db")
    with Spool(tmp_path, reserve_bytes=0) as opened:
        assert [file.name for file in opened.damaged()] == ["00000001.damaged.db"]
        assert (tmp_path / "00000001.damaged.db-wal").read_bytes() == files["00000001.db-wal"]
        assert Uploader(opened, lambda: Store(folder_url))._empty(asked=True)
    assert told(Store(folder_url)) == [("", 1)]
