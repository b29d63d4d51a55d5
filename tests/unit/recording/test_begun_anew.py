"""A store that is emptied, or replaced by another one: uploading goes on, and that is told once."""

import shutil
from pathlib import Path

import pytest

from ml.store import Store, StoreError
from ml.store.tables import TELEMETRY
from server_gui.core.cloud import actions
from server_gui.core.cloud.jobs import Job
from server_gui.core.recording.errors import Damaged
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from tests.unit.recording.robots import batch

HERE = TELEMETRY.location("exo-01", 1)


def record(folder: Path, seq: int, mark: str | None = None) -> None:
    """A row, a session and, if one is given, a marker, which wait for upload then."""
    with Spool(folder, reserve_bytes=0) as spool, Recorder(spool) as recorder:
        recorder.record("exo-01", 1, batch(seq))
        if mark is not None:
            recorder.mark("exo-01", mark)


def uploaded(folder: Path, url: str) -> tuple[str, ...]:
    """What a collector that uploads what waits gives an alarm for."""
    with Spool(folder, reserve_bytes=0) as spool:
        uploader = Uploader(spool, lambda: Store(url))
        assert uploader._empty(asked=True)
        return uploader.state.lost


def told(store: Store) -> list[tuple[str, str]]:
    events = store.dataset("events").to_table().to_pylist()
    return [(line["robot"], line["text"]) for line in events if line["kind"] == "lost"]


@pytest.mark.parametrize("by", ["nothing", "another store"])
def test_a_store_that_is_another_one_is_uploaded_to_with_an_alarm_and_an_event(
    tmp_path: Path, folder_url: str, by: str, caplog: pytest.LogCaptureFixture
) -> None:
    spool, folder = tmp_path / "spool", Store(folder_url).folder
    assert folder is not None
    for seq in range(2):
        record(spool, seq)
        assert uploaded(spool, folder_url) == ()
    shutil.rmtree(folder)
    if by == "another store":
        record(tmp_path / "other", 7)
        assert uploaded(tmp_path / "other", folder_url) == ()
    record(spool, 2)
    [alarm] = uploaded(spool, folder_url)
    assert alarm.startswith(
        f"2 batches of the spool {spool} went to {folder_url}, and that is not the same store any more"
    )
    assert alarm in caplog.messages
    store = Store(folder_url)
    assert told(store) == [("exo-01", alarm)]
    assert 2 in store.dataset(HERE).to_table()["seq"].to_pylist()
    record(spool, 3, "a table that nothing has gone to since")
    assert uploaded(spool, folder_url) == ()
    assert told(store) == [("exo-01", alarm)]


def test_a_store_that_is_emptied_while_it_is_uploaded_to_is_told(tmp_path: Path, folder_url: str) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        uploader = Uploader(spool, lambda: Store(folder_url))
        for seq in range(2):
            with Recorder(spool) as recorder:
                recorder.record("exo-01", 1, batch(seq))
            while not uploader._empty(asked=True):  # a table that it has open is gone
                pass
            if seq == 0:
                assert uploader.state.lost == ()
                shutil.rmtree(Store(folder_url).folder or "")
        [alarm] = uploader.state.lost
    assert told(Store.existing(folder_url)) == [("exo-01", alarm)]


def test_a_copy_of_the_store_in_another_place_is_no_alarm(tmp_path: Path, folder_url: str) -> None:
    spool, folder = tmp_path / "spool", Store(folder_url).folder
    assert folder is not None
    record(spool, 0, "here")
    assert uploaded(spool, folder_url) == ()
    copy = tmp_path / "copy"
    shutil.copytree(folder, copy)
    record(spool, 1, "there")
    assert uploaded(spool, copy.as_uri()) == ()
    shutil.rmtree(folder)
    copy.rename(folder)  # and back again
    record(spool, 2, "here")
    assert uploaded(spool, folder_url) == ()


@pytest.mark.parametrize("by", ["nothing", "another store"])
def test_who_uploads_by_hand_is_told_that_the_store_is_another_one(
    tmp_path: Path, folder_url: str, by: str
) -> None:
    spool, folder = tmp_path / "spool", Store(folder_url).folder
    assert folder is not None
    record(spool, 0)
    assert uploaded(spool, folder_url) == ()
    shutil.rmtree(folder)
    record(spool, 1)
    said = "there is no store at"
    if by == "another store":
        record(tmp_path / "other", 7)
        assert uploaded(tmp_path / "other", folder_url) == ()
        said = "is not the same store any more"
    settings = ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool))
    with pytest.raises((StoreError, Damaged), match=said):
        actions.upload(settings)(Job("Upload"))
    with Spool(spool, reserve_bytes=0) as opened:
        assert bool(opened.waiting()) is (by == "nothing")
