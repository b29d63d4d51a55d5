"""Compaction by a collector: when it is time, beside it, and never in its way."""

import errno
import logging
import os
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from ml.store import Store
from ml.store.tables import TELEMETRY
from server_gui.core.recording import compaction
from server_gui.core.recording.compaction import Compaction
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import until
from tests.unit.recording.robots import batch

HERE = TELEMETRY.location("exo-01", 1)
HOUR_S = 3600.0


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    """Three batches that wait."""
    with Spool(tmp_path / "spool", reserve_bytes=0) as opened:
        for seq in range(3):
            with Recorder(opened) as recorder:
                recorder.record("exo-01", 1, batch(seq), clock_offset_ns=0)
        yield opened


def long_ago(folder: Path) -> None:
    os.utime(folder / "compacted", (0.0, 0.0))


def test_an_uploader_compacts_the_store_when_it_is_time(
    spool: Spool, store_url: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    compacting = Compaction(store_url, spool.folder, HOUR_S)
    (spool.folder / "compacted").touch()
    long_ago(spool.folder)
    with Uploader(spool, lambda: Store(store_url), compacting=compacting):
        until(lambda: any("were put together" in record.getMessage() for record in caplog.records))
    store = Store(store_url)
    assert len(store.table("sessions").file_uris()) == 1  # of three; telemetry has one a session already
    assert store.dataset(HERE).count_rows() == 3
    assert time.time() - (spool.folder / "compacted").stat().st_mtime < HOUR_S


def test_the_first_time_is_one_period_after_the_first_use(tmp_path: Path) -> None:
    compacting = Compaction("file:///nowhere", tmp_path, HOUR_S)
    for _ in range(2):
        compacting.look()
        assert compacting._process is None
    long_ago(tmp_path)
    compacting.look()
    begun = compacting._process
    assert begun is not None
    compacting.close()
    assert begun.returncode is not None  # it was ended, and waited for
    compacting.close()


def test_a_compaction_that_fails_is_said_and_not_tried_again_at_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    program = "import sys; sys.exit(f'gwrms cloud: {sys.argv[1]!r} is no store')"
    monkeypatch.setattr(compaction, "COMMAND", ("-c", program))
    compacting = Compaction("ftp://nowhere", tmp_path, HOUR_S)
    (tmp_path / "compacted").touch()
    long_ago(tmp_path)
    compacting.look()

    def ended() -> bool:
        compacting.look()
        return compacting._process is None

    until(ended)
    assert "the store was not compacted: gwrms cloud: 'ftp://nowhere' is no store" in caplog.text
    compacting.look()
    assert compacting._process is None


@pytest.mark.parametrize("fails", ["process", "note"])
def test_a_compaction_that_cannot_be_begun_is_said_once_and_ends_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture, fails: str
) -> None:
    def fail(*_: object, **__: object) -> None:
        raise OSError(errno.ENOMEM, "no memory")

    (tmp_path / "compacted").touch()
    long_ago(tmp_path)
    owner, name = {"process": (subprocess, "Popen"), "note": (Path, "touch")}[fails]
    monkeypatch.setattr(owner, name, fail)
    compacting = Compaction("file:///nowhere", tmp_path, 0.0)
    for _ in range(3):
        compacting.look()
        compacting.close()
    said = [record.getMessage() for record in caplog.records]
    assert said == ["the store was not compacted: [Errno 12] no memory"]
