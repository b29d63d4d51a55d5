"""The store in the window: shown without its keys, uploaded to, verified; jobs can be cancelled."""

import shutil
import time
from pathlib import Path

import pytest
from msgspec.structs import replace
from PySide6.QtCore import QRect, Qt
from PySide6.QtWidgets import QPushButton, QTreeWidgetItem

from ml.store import Store, StoreError
from server_gui.core.archive import library
from server_gui.core.archive.archive import Archive
from server_gui.core.cloud.jobs import Job, Jobs, JobState
from server_gui.core.cloud.store_reach import Reach
from server_gui.core.desk.recording import By, Recording
from server_gui.core.recording.uploader import UploaderState
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.cloud.jobs_table import SAID, JobsTable
from server_gui.views.theme import Theme
from tests.gui.archives import Shown, cell, record
from tests.gui.fakes import Bench, destroy
from tests.gui.rules import settle
from tests.gui.test_recording import FakeKeeper, report
from tests.support.desk import described, looked, walking


def test_the_store_is_shown_with_where_its_keys_come_from_and_never_the_keys(
    shown: Shown, archive: Archive, settings: ServerSettings
) -> None:
    record(settings)
    shown.open("Cloud")
    cloud = shown.window.tabs.cloud
    shown.until(lambda: "Reached" in cloud.state.text(), "reached it")
    assert cloud._facts["URL"].text() == settings.store.url
    assert cloud._facts["Keys"].text() == "none needed: it is a folder"
    tops = below(cloud.browser.invisibleRootItem())
    assert [top.text(0) for top in tops] == ["telemetry", "sessions", "events", "predictions"]
    tops[0].setExpanded(True)
    robot = below(tops[0])[0]
    assert robot.text(0) == "exo-01"
    robot.setExpanded(True)
    shown.until(lambda: below(robot)[0].text(0).endswith(".parquet"), "listed its files")


def below(item: QTreeWidgetItem) -> list[QTreeWidgetItem]:
    found = [item.child(row) for row in range(item.childCount())]
    return [child for child in found if child is not None]


def test_a_store_that_is_away_says_so_and_is_tried_again(
    shown: Shown, archive: Archive, settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(library, "AGAIN_S", 0.0)
    existing = Store.existing
    away = [True]

    def reach(url: str | None = None) -> Store:
        if away[0]:
            raise StoreError("s3://lab cannot be reached: Connection refused")
        return existing(url)

    monkeypatch.setattr(Store, "existing", reach)
    record(settings)
    shown.open("Cloud")
    shown.until(lambda: "Connection refused" in shown.window.tabs.cloud.state.text(), "said so")
    assert shown.window.tabs.cloud._facts["Holds"].text() == "not known"
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    assert "not reached, retried automatically" in page.said.text()
    assert page._list.note == "0 sessions known; others may be in the store"
    away[0] = False
    shown.until(lambda: shown.window.tabs.recordings.list.sessions.rowCount(), "came back")
    shown.open("Cloud")
    assert "Reached" in shown.window.tabs.cloud.state.text()


def test_upload_now_asks_who_records_and_does_it_itself_where_nobody_does(
    shown: Shown, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    record(settings, sent=False)
    shown.open("Cloud")
    cloud = shown.window.tabs.cloud
    cloud.upload.click()
    job = archive.jobs.jobs[0]
    shown.until(lambda: job.is_over, "uploaded it")
    assert "nothing waits" in job.said
    shown.until(lambda: any("nothing waits" in item.text for item in bench.desk.news.items), "told it")
    keeper = FakeKeeper(report(problem="the store cannot be reached", waiting=2))
    cloud._recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)
    cloud._recording.look()
    shown.draw()
    assert "5.0 MiB not uploaded yet: 2 batches · " in cloud.waiting.text()
    assert "2 batches uploaded\n" in cloud.waiting.text()
    assert "Not uploaded, retried automatically: the store cannot be reached" in cloud.waiting.text()
    cloud.upload.click()
    assert keeper.asked == ["upload"]
    said = "what was recorded until now waits for the store: an upload failed, retried automatically"
    assert said in [item.text for item in bench.desk.news.items]


@pytest.mark.parametrize(
    ("pending", "said"),
    [(0, "nothing waits · "), (1 << 20, "1.0 MiB not uploaded yet: less than a batch · ")],
)
def test_rows_that_are_no_batch_yet_wait_as_well(
    shown: Shown, archive: Archive, bench: Bench, pending: int, said: str
) -> None:
    recorded = replace(report(), uploader=UploaderState(2, 0, pending))
    shown.open("Cloud")
    cloud = shown.window.tabs.cloud
    cloud._recording = Recording(By.WINDOW, FakeKeeper(recorded), lambda call: call(), bench.desk.news)
    cloud._recording.look()
    shown.draw()
    assert cloud.waiting.text().startswith(said)


def test_while_the_store_is_away_the_button_tries_again_at_once(
    shown: Shown, archive: Archive, settings: ServerSettings, tmp_path: Path, bench: Bench
) -> None:
    record(settings)
    shown.open("Cloud")
    cloud, reach = shown.window.tabs.cloud, archive.library.reach
    shown.until(lambda: reach.state is Reach.REACHED, "reached it")
    shown.draw()
    assert cloud.upload.text() == "Upload now"
    reach.looked("it cannot be reached")
    shown.draw()
    assert cloud.upload.text() == "Try again now"
    assert cloud.upload.isEnabled()
    assert cloud.state.width() > cloud._cards["Store"].width() * 0.8, "a reason has all of the width"
    again = next(one for one in cloud.findChildren(QPushButton) if one.text() == "Look again")
    assert again.toolTip() != cloud.upload.toolTip(), "both say what they do"
    assert again.geometry().bottom() <= cloud.state.geometry().top()
    keeper = FakeKeeper(report())
    cloud._recording = recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)
    recording.rely_on(reach)
    recording.look()
    assert not reach.is_due, "nobody else looks again"
    cloud.upload.click()
    assert keeper.asked[0] == "upload"
    said = "what was recorded until now waits for the store: it is not reached, retried automatically"
    assert said in [item.text for item in bench.desk.news.items]
    shown.until(lambda: reach.state is Reach.REACHED, "looked at once")
    cloud.upload.click()
    assert "what was recorded until now goes to the store" in [item.text for item in bench.desk.news.items]


def test_a_job_shows_how_far_it_is_and_can_be_cancelled(shown: Shown, archive: Archive) -> None:
    def long(job: Job) -> str:
        job.expect(10, "files")
        job.done = 4
        while True:
            job.check()
            time.sleep(0.001)  # the work, until it is cancelled

    job = archive.jobs.add("Verify", long)
    shown.open("Cloud")
    table = shown.window.tabs.cloud.jobs
    shown.until(lambda: cell(shown, 2) == "4 of 10 files", "showed how far it is")
    cancel = table.cellWidget(0, 3)
    assert isinstance(cancel, QPushButton)
    cancel.click()
    shown.until(lambda: job.state is JobState.CANCELLED, "cancelled it")
    shown.until(lambda: table.cellWidget(0, 3) is None, "took the button away")


def test_a_store_is_downloaded_and_verified(
    shown: Shown, archive: Archive, settings: ServerSettings, tmp_path: Path
) -> None:
    record(settings)
    shown.open("Cloud")
    shown.window.tabs.cloud.download_to(tmp_path / "copy", ())
    shown.window.tabs.cloud._verify(deep=True)
    shown.until(lambda: all(job.is_over for job in archive.jobs.jobs), "did both")
    assert [job.state for job in archive.jobs.jobs] == [JobState.DONE, JobState.DONE]
    assert Store((tmp_path / "copy").as_uri()).dataset("sessions").count_rows() > 0


@pytest.mark.parametrize("width", [500, 1200])
def test_what_came_of_a_job_is_whole(theme: Theme, width: int) -> None:
    jobs = Jobs()
    said = f"Better: {'F1 on held-out people ' * 8}0.97"
    jobs.jobs.appendleft(Job("Train activity", JobState.DONE, said=said))
    table = JobsTable(jobs, theme)
    table.resize(width, 300)
    table.show()
    table.refresh()
    settle()
    room = table.visualItemRect(item) if (item := table.item(0, SAID)) is not None else QRect()
    wraps = Qt.TextFlag.TextWordWrap
    needs = table.fontMetrics().boundingRect(QRect(0, 0, room.width() - 8, 10_000), wraps, said)
    assert room.height() >= needs.height() > 0
    assert jobs.close(1.0)
    destroy(table)


def test_models_and_cloud_see_at_once_that_the_store_has_gone(
    whole: Shown, archive: Archive, settings: ServerSettings, bench: Bench, tmp_path: Path
) -> None:
    record(settings)
    archive.library.knock(now=True)
    whole.until(lambda: bench.desk.reach.state is Reach.REACHED, "reached it")
    whole.open("Models")
    bench.desk.reach.uploads("the disk is full")
    state = whole.window.tabs.models.state
    whole.until(lambda: state.text() == f"▲ Store: {bench.desk.reach.said}", "said so")
    whole.open("Cloud")
    bench.desk.reach.uploads(None)
    bench.desk.reach.looked(None)
    shutil.move(tmp_path / "store", tmp_path / "away")
    assert not bench.desk.reach.is_due
    whole.open("Models")
    whole.until(lambda: bench.desk.reach.state is Reach.AWAY, "saw that it is gone")
    whole.until(lambda: "ot reached" in state.text(), "said so")


def test_no_place_is_green_while_the_store_is_gone_and_every_one_is_again_when_it_is_back(
    whole: Shown, archive: Archive, settings: ServerSettings, bench: Bench, tmp_path: Path
) -> None:
    record(settings)
    keeper = FakeKeeper(report())
    bench.desk.recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)
    bench.desk.recording.look()
    bench.station.take([described(), walking(100), looked()])
    bench.station.predictions.foresees = False
    strip = whole.window.alarms  # type: ignore[union-attr]

    def said() -> str:
        return strip.accessibleDescription()

    whole.draw()
    assert said() == "No alarms; the store is not known"
    archive.look()
    whole.until(lambda: said() == "No alarms; all ok", "looked at it")
    shutil.move(tmp_path / "store", tmp_path / "away")
    bench.desk.reach.uploads("x")
    bench.desk.reach.uploads(None)  # so that somebody looks at once
    archive.look()
    whole.until(lambda: "any more" in said(), "saw that it is gone")
    tabs = whole.window.tabs
    for page, state in (
        ("Models", tabs.models.state),
        ("Recordings", tabs.recordings.list.said),
        ("Cloud", tabs.cloud.state),
    ):
        whole.open(page)
        assert "ot reached" in state.text(), page
        assert "all ok" not in said(), page
    shutil.move(tmp_path / "away", tmp_path / "store")
    archive.library.look(now=True)
    whole.until(lambda: said() == "No alarms; all ok", "saw that it is back")
    assert whole.window.tabs.cloud.state.text().startswith("Reached")
