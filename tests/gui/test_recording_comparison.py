"""Two recordings are marked, and what changed from one to the other is shown, and what moved with it."""

import msgspec
import pytest

from gateway.units import Units
from server_gui.core.archive.archive import Archive
from server_gui.core.settings.server_file import ServerSettings
from server_gui.views.recordings.comparison import NOT_THE_CAUSE, ComparisonPage
from server_gui.views.recordings.panel import CHANGED, LIST
from tests.gui.archives import ADA, Shown, record
from tests.gui.fakes import Bench


def compared(shown: Shown, archive: Archive, settings: ServerSettings) -> ComparisonPage:
    """Two recordings, of which the second has another gain and tells no firmware."""
    setup = {"component/left_knee": "joint", "firmware/left_knee": "1.2", "object/gait.step_length": "gait m"}
    before, after = (
        {"left_knee.gain": gain, "gait.step_length": step} for gain, step in ((2.0, 0.4), (3.0, 0.43))
    )
    record(settings, facts=msgspec.structs.replace(ADA, parameters=before, setup=setup))
    record(settings, facts=msgspec.structs.replace(ADA, parameters=after, operator="Bert"))
    archive.library.look(now=True)
    shown.open("Recordings")
    page = shown.window.tabs.recordings.list
    shown.until(lambda: page.sessions.rowCount() == 2, "listed both")
    page.table.selectRow(0)
    shown.draw()
    assert not page.compare.isEnabled()
    page.table.selectAll()
    shown.draw()
    assert len(page.marked) == 2
    page.compare.click()
    assert shown.window.tabs.recordings.currentIndex() == CHANGED
    return shown.window.tabs.recordings.changed


def cells(page: ComparisonPage) -> list[list[str]]:
    table = page.changed.model()
    return [
        [str(table.index(row, column).data()) for column in range(table.columnCount())]
        for row in range(table.rowCount())
    ]


def test_what_changed_is_listed_and_what_is_not_recorded_is_said(
    shown: Shown, archive: Archive, settings: ServerSettings, bench: Bench
) -> None:
    page = compared(shown, archive, settings)
    shown.until(lambda: archive.compared.moved, "compared both walks")
    assert cells(page) == [
        ["parameter", "left_knee.gain", "2", "3"],
        ["parameter", "gait.step_length", "400 mm", "430 mm"],
        ["operator", "operator", "Ada", "Bert"],
    ]
    bench.desk.shown.change(Units(by_si={"m": "cm"}))
    shown.draw()
    assert cells(page)[1] == ["parameter", "gait.step_length", "40 cm", "43 cm"]
    assert "left_knee firmware (1.2 before)" in page.unknown.text()
    assert "not recorded in either: wearer, calibration" in page.unknown.text()
    assert NOT_THE_CAUSE in page.verdict.text()
    assert "gait cycle" in page.verdict.text()
    page.left.emit()
    assert shown.window.tabs.recordings.currentIndex() == LIST


def test_a_store_that_cannot_be_read_is_said_and_nothing_is_shown_as_unchanged(
    shown: Shown, archive: Archive, settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_: object) -> None:
        raise OSError("the disk is away")

    monkeypatch.setattr("server_gui.core.archive.recording_comparison.Recordings", broken)
    page = compared(shown, archive, settings)
    shown.until(lambda: archive.compared.problem, "told why not")
    shown.draw()
    assert page.unknown.text() == "Not known: the disk is away"
    assert page.verdict.text() == "Not known: the disk is away"
    assert cells(page) == []
