"""Audit: what people did is found, told in their units, exported exactly; a broken record shows."""

import csv
from collections.abc import Iterator
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication

from gateway.units import Units
from server_gui.core.archive.collected_journals import CollectedJournal, JournalsFound, KeptJournals
from server_gui.core.audit.chains import chained, problem
from server_gui.core.follow.events import Journalled
from server_gui.views.audit.acts_model import (
    NEW,
    OLD,
    OUTCOME,
    READ_BACK,
    ROBOT,
    THING,
    TIME,
    TOLD_BY,
    UNIT,
    WHAT,
    WHO,
)
from server_gui.views.audit.page import NONE, NONE_CHOSEN, Audit
from server_gui.views.theme import Theme
from tests.gui import rules
from tests.gui.fakes import Bench, destroy
from tests.support.desk import described
from tests.support.journals import RobotsJournal

STEP, ANGLE = "gait.step_length", "gait.trunk_angle"


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[RobotsJournal]:
    made = RobotsJournal(tmp_path)
    made.written({STEP: 0.4}, {STEP: 0.43})
    made.say("stop", who="ben at 10.0.0.4", reason="STOP key")
    made.written({ANGLE: 0.05}, {ANGLE: 0.1}, "trial begun")
    yield made
    made.close()


@pytest.fixture
def view(theme: Theme, bench: Bench, journal: RobotsJournal) -> Iterator[Audit]:
    bench.station.take([journal.told()])
    made = Audit(bench.desk, theme)
    made.resize(900, 500)
    made.show()
    made.refresh()
    yield made
    destroy(made)


def test_titles_alone_are_nothing_to_scroll_to(theme: Theme, bench: Bench) -> None:
    made = Audit(bench.desk, theme)
    made.resize(400, 300)
    made.show()
    made.refresh()
    assert not made.table.horizontalScrollBar().isVisible()
    destroy(made)


def test_without_a_row_it_says_what_would_be_there_and_how_it_comes(theme: Theme, bench: Bench) -> None:
    made = Audit(bench.desk, theme)
    made.resize(500, 400)
    made.show()
    made.refresh()
    assert made.empty.isVisible()
    assert made.empty.text() == NONE
    assert not made.table.isVisible()
    QApplication.processEvents()
    assert rules.cut_words(made, [made.empty]) == []
    destroy(made)


def test_where_filters_leave_no_row_they_are_what_is_told_of(view: Audit) -> None:
    assert view.table.isVisible()
    view.words.setText("no such thing")
    assert view.empty.text() == NONE_CHOSEN
    assert not view.table.isVisible()
    view.words.clear()
    assert view.table.isVisible()
    assert not view.empty.isVisible()


def column(view: Audit, place: int) -> list[str]:
    view.refresh()
    return [str(view.chosen.index(row, place).data()) for row in range(view.chosen.rowCount())]


def test_a_change_is_told_newest_first_with_old_new_and_read_back(view: Audit) -> None:
    assert column(view, WHAT) == ["trial of 20 s", "stop", "write"]
    assert column(view, THING) == [ANGLE, "", STEP]
    assert [column(view, place)[2] for place in (OLD, NEW, READ_BACK, UNIT)] == ["400", "430", "430", "mm"]
    assert column(view, OUTCOME) == ["on trial, read back", "STOP key", "written and read back"]


def test_values_are_told_in_the_units_of_choice(view: Audit, bench: Bench) -> None:
    bench.desk.shown.change(Units(by_si={"m": "cm"}))
    assert (column(view, NEW)[2], column(view, UNIT)[2]) == ("43", "cm")


def test_what_comes_later_changes_its_line_and_keeps_the_selection(
    view: Audit, bench: Bench, journal: RobotsJournal
) -> None:
    view.table.selectRow(2)
    journal.say("trial confirmed", write=2)
    journal.say("stop", reason="again")
    bench.station.take([journal.told()])
    assert column(view, OUTCOME) == ["again", "kept after its trial", "STOP key", "written and read back"]
    assert [index.siblingAtColumn(THING).data() for index in view.table.selectionModel().selectedRows()] == [
        STEP
    ]


def test_robot_who_and_words_find_lines(view: Audit, bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = RobotsJournal(tmp_path / "other")
    other.say("stop", who="ben at 10.0.0.4", reason="there")
    bench.add("exo-02", 7421).take([described("exo-02"), other.told()])
    other.close()
    assert len(column(view, WHAT)) == 4
    view.robot.setCurrentText("exo-02")
    assert column(view, OUTCOME) == ["there"]
    view.robot.setCurrentIndex(0)
    view.who.setCurrentText("ben at 10.0.0.4")
    assert column(view, WHAT) == ["stop", "stop"]
    view.who.setCurrentIndex(0)
    view.words.setText("step write")
    assert column(view, THING) == [STEP]


def test_two_robots_of_one_name_are_told_apart(view: Audit, bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    other = RobotsJournal(tmp_path / "other")
    other.say("stop", reason="there")
    bench.add("the other", 7421).take([described("exo-01"), other.told()])
    other.close()
    view.refresh()
    view.robot.setCurrentText(bench.desk.stations[1].title)
    assert column(view, OUTCOME) == ["there"]


def test_every_column_sorts_both_ways(view: Audit) -> None:
    view.table.sortByColumn(NEW, Qt.SortOrder.AscendingOrder)
    assert column(view, NEW) == ["", "5.73", "430"]
    view.table.sortByColumn(WHO, Qt.SortOrder.DescendingOrder)
    assert column(view, WHO)[0] == "ben at 10.0.0.4"
    view.table.sortByColumn(TIME, Qt.SortOrder.AscendingOrder)
    assert column(view, WHAT)[0] == "write"


def test_an_export_has_what_is_shown_in_si_units_with_every_digit(view: Audit, tmp_path: Path) -> None:
    view.words.setText("trial")
    view.save_csv(tmp_path / "audit.csv")
    titles, line = csv.reader((tmp_path / "audit.csv").read_text(encoding="utf-8").splitlines())
    told = dict(zip(titles, line, strict=True))
    assert (told["robot"], told["thing"], told["old"], told["new"], told["unit"]) == (
        "exo-01",
        ANGLE,
        "0.05",
        "0.1",
        "rad",
    )
    assert told["utc"].endswith("+00:00")


def test_whether_the_record_holds_is_always_said(view: Audit, bench: Bench, journal: RobotsJournal) -> None:
    assert view.verdict.text() == (
        "exo-01: Entries 1 to 5 are unaltered and in their places: the chain of hashes holds."
    )
    journal.say("stop", reason="again")
    told = journal.told()
    told.journal.entries[-1]["who"] = "nobody"
    bench.station.take([Journalled(told.journal)])
    view.refresh()
    assert "NOT INTACT: line 6 was altered" in view.verdict.text()
    assert view.verdict.property("tone") == "bad"


def test_a_robot_without_an_entry_in_its_journal_is_not_called_unread(theme: Theme, bench: Bench) -> None:
    made = Audit(bench.desk, theme)
    made.refresh()
    assert made.verdict.text() == (
        "exo-01: No entry of the robot's journal has come yet: none was written, or it is still being read."
    )


# --- what was collected before


class Collected(KeptJournals):
    """Has what the test gives it."""

    def __init__(self) -> None:
        self.found = JournalsFound()

    def look(self) -> None:
        pass

    def keep(self, robot: str, told: Journalled) -> None:
        stretches = chained(told.journal.entries)
        self.found = JournalsFound(
            {**self.found.by_robot, robot: CollectedJournal(tuple(stretches), problem(stretches))}
        )


@pytest.fixture
def collected() -> Collected:
    return Collected()


@pytest.fixture
def whole(theme: Theme, bench: Bench, collected: Collected) -> Iterator[Audit]:
    made = Audit(bench.desk, theme, collected)
    made.show()
    yield made
    destroy(made)


def test_what_the_store_has_is_shown_once_with_where_it_comes_from(
    whole: Audit, bench: Bench, journal: RobotsJournal, collected: Collected
) -> None:
    collected.keep("exo-01", journal.told())
    assert column(whole, TOLD_BY) == ["store"] * 3
    newest = journal.told(2)
    bench.station.take([newest])
    assert column(whole, THING) == [ANGLE, "", STEP]
    assert column(whole, TOLD_BY) == ["robot", "store", "store"]
    assert whole.verdict.text() == (
        "exo-01: Entries 4 to 5 are unaltered and in their places: the chain of hashes holds; "
        "collected were 5 entries, unaltered, without a hole."
    )


def test_a_robot_that_is_away_is_there_by_what_was_collected_of_it(
    whole: Audit, journal: RobotsJournal, collected: Collected
) -> None:
    collected.keep("exo-07", journal.told())
    assert column(whole, ROBOT) == ["exo-07"] * 3
    assert column(whole, NEW)[2] == "0.43", "in SI: nobody tells its unit"
    whole.robot.setCurrentText("exo-07")
    assert whole.verdict.text() == "exo-07: collected were 5 entries, unaltered, without a hole."


def test_what_was_altered_on_the_robot_after_it_was_collected_shows(
    whole: Audit, bench: Bench, journal: RobotsJournal, collected: Collected, tmp_path: Path
) -> None:
    collected.keep("exo-01", journal.told())
    (tmp_path / "fork").mkdir()
    lines = (tmp_path / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "fork" / "journal.jsonl").write_bytes(b"".join(lines[:2]))
    fork = RobotsJournal(tmp_path / "fork")
    fork.say("stop", reason="another one")
    bench.station.take([fork.told()])
    fork.close()
    whole.refresh()
    assert "robot and store differ, entry 3 is there in two versions" in whole.verdict.text()
    assert whole.verdict.property("tone") == "bad"


def test_a_store_that_is_away_is_said_calmly(whole: Audit, collected: Collected) -> None:
    collected.found = JournalsFound(problem="s3://lab cannot be reached: Connection refused")
    whole.refresh()
    assert "cannot be read now; retrying: s3://lab cannot be reached" in whole.verdict.text()
    assert whole.verdict.property("tone") != "bad"
