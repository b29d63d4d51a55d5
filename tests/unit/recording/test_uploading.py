"""The uploader's thread: nothing that it is asked for is forgotten, whenever that is."""

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from ml.store import Store
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.uploader import Uploader
from tests.support.waiting import until
from tests.unit.recording.robots import batch

WAIT_S = 5.0


class Between(threading.Event):
    """An event, with something that happens once, just after a look at it or just before it is cleared."""

    def __init__(self) -> None:
        super().__init__()
        self.after_look: Callable[[], object] | None = None
        self.before_clear: Callable[[], object] | None = None
        self.sets = 0

    def set(self) -> None:
        super().set()
        self.sets += 1

    def is_set(self) -> bool:
        found, happens = super().is_set(), self.after_look
        if happens is not None:
            self.after_look = None
            happens()
        return found

    def clear(self) -> None:
        if self.before_clear is not None:
            happens, self.before_clear = self.before_clear, None
            happens()
        super().clear()


@pytest.fixture
def spool(tmp_path: Path) -> Iterator[Spool]:
    with Spool(tmp_path / "spool", reserve_bytes=0) as opened:
        with Recorder(opened) as recorder:
            recorder.record("exo-01", 1, batch(0))
        yield opened


def test_rows_wait_from_the_first_on_and_before_the_next_attempt(tmp_path: Path) -> None:
    with Spool(tmp_path / "spool", reserve_bytes=0) as spool:
        uploader = Uploader(spool, lambda: Store("file:///nowhere"))
        assert uploader.look().backlog_bytes == 0, "an empty file waits for nothing"
        with Recorder(spool) as recorder:
            recorder.record("exo-01", 1, batch(0))
            assert recorder.flush(WAIT_S)
            newest = uploader.look()
            assert (newest.waiting, newest.backlog_bytes > 0) == (0, True)
        assert uploader.look().waiting == 1


def test_an_upload_that_is_asked_for_between_two_looks_is_made(spool: Spool, folder_url: str) -> None:
    uploader = Uploader(spool, lambda: Store(folder_url), wanted=lambda: False)
    asked = uploader._asked = Between()
    asked.after_look = uploader.now
    with uploader:
        until(lambda: uploader.state.uploaded == 1)


def test_an_end_that_is_asked_for_between_two_looks_is_one(
    spool: Spool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.core.recording.uploader.LOOK_S", 10 * WAIT_S)
    uploader = Uploader(spool, lambda: Store("file:///nowhere"), wanted=lambda: False)
    asked = uploader._asked = Between()
    closed: list[bool] = []
    closing = threading.Thread(target=lambda: closed.append(uploader.close(WAIT_S)))

    def close() -> None:
        closing.start()
        until(lambda: asked.sets == 2)

    asked.before_clear = close
    uploader.now()
    uploader.worker.start()
    until(lambda: closed)
    closing.join()
    uploader.close()
    assert closed == [True]
