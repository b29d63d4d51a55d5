"""The page of edits, and a trial's bar: what an edit did, while it counts down and afterwards."""

import time

import pytest
from msgspec.structs import replace
from PySide6.QtCore import QEvent, QPointF, QRectF, Qt
from PySide6.QtGui import QImage, QMouseEvent, QPainter
from PySide6.QtWidgets import QApplication

from gateway.units import Units
from server_gui.core.evidence.comparison import Word, compare
from server_gui.core.evidence.curves import Curves, Side
from server_gui.core.evidence.cycles import DRAWN
from server_gui.core.evidence.edits import EditState, ParameterChange
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.tuning.writing import Trial
from server_gui.views.edits.page import Edits, _by_our_clock
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.theme import Theme
from server_gui.views.widgets.plot_frame import draw_frame
from server_gui.views.widgets.scroll_area import ScrollArea
from server_gui.views.widgets.stride_curves import CYCLE
from tests.gui.fakes import Bench, Parts, destroy
from tests.gui.rules import settle
from tests.support.desk import looked, walking
from tests.unit.evidence.synthetic import cycles, spell
from tests.unit.evidence.test_comparison import ERROR, times
from tests.unit.evidence.test_file import told


def worse(write: int = 1, *, is_final: bool = True) -> EditEvidence:
    """An edit after which a knee tracks by a fifth worse."""
    before, after = Side((0.1,) * 101, (0.01,) * 101, 40), Side((0.2,) * 101, (0.01,) * 101, 41)
    curves = tuple(Curves(f"left_knee.{name}", before, after) for name in ("position", "following_error"))
    evidence = compare(cycles(times(ERROR, 1.2)), spell(), ["left_knee"], ["left_knee"])
    return replace(told(write), evidence=evidence, curves=curves, is_final=is_final)


def test_the_newest_edit_is_shown_with_its_word_and_its_strides(bench: Bench, window: MainWindow) -> None:
    window.tabs.look_at(window.tabs.edits)
    window.refresh()
    assert "No edit is known yet" in window.tabs.edits.words.text()
    bench.station.judged.take(worse())
    window.tabs.edits.refresh()
    assert window.tabs.edits.list.count() == 1
    assert "worse (" in window.tabs.edits.verdict.text()
    assert "left knee tracking error RMS worse: +19.2 %" in window.tabs.edits.words.text()
    assert "No data for " in window.tabs.edits.words.text()
    assert set(window.tabs.edits.curves) == {"left_knee.position", "left_knee.following_error"}
    described = window.tabs.edits.curves["left_knee.position"].accessibleDescription()
    assert described.startswith("40 strides before and 41 after, from ")


def test_values_and_metrics_are_in_the_units_that_were_chosen(bench: Bench, parts: Parts) -> None:
    bench.station.take([looked()])
    one = worse()
    bench.station.judged.take(
        replace(one, edit=replace(one.edit, changes=(ParameterChange("gait.step_length", 0.4, 0.43),)))
    )
    parts.edits.refresh()
    assert "step length (gait) 400 → 430 mm: worse" in parts.edits.verdict.text()
    assert "0.05993 °" in parts.edits.words.toolTip()
    assert (
        "(95 % interval +17.5 to +20.9 %); as measured, drift and all: 0.2867 → 0.3433 °"
        in parts.edits.words.text()
    )
    bench.desk.shown.change(Units(by_si={"m": "m", "rad": "rad"}))
    parts.edits.refresh()
    assert "step length (gait) 0.40 → 0.43 m: worse" in parts.edits.verdict.text()
    assert "0.001046 rad" in parts.edits.words.toolTip()


def test_strides_stand_below_each_other_rather_than_beyond_the_edge(bench: Bench, theme: Theme) -> None:
    page = Edits(bench.desk, theme)
    scrolled = ScrollArea(page)
    one = worse()
    curves = tuple(replace(one.curves[0], channel=f"left_knee.{name}") for name in DRAWN)
    bench.station.judged.take(replace(one, curves=curves))
    page.refresh()
    scrolled.show()
    rows = {}
    for width in (1000, 600, 400, 240):
        scrolled.resize(width, 500)
        settle()
        assert page.width() <= scrolled.viewport().width()
        rows[width] = len({one.y() for one in page.curves.values()})
    assert rows == {1000: 1, 600: 1, 400: 2, 240: 4}
    destroy(scrolled)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_no_figure_lies_over_a_curve(theme: Theme, scale: float) -> None:
    theme.set(scale=scale)
    image = QImage(theme.px(180), theme.px(130), QImage.Format.Format_RGB32)
    painter = QPainter(image)
    area = draw_frame(painter, theme, QRectF(image.rect()), "left knee (°)", ("-12.5", "110.0"), CYCLE)
    metrics = painter.fontMetrics()
    painter.end()
    assert area.left() >= max(map(metrics.horizontalAdvance, ("-12.5", "110.0")))
    assert image.height() - area.bottom() >= metrics.height()
    assert area.top() >= metrics.height()
    assert area.width() > 0.4 * image.width()


def test_who_looks_at_an_older_edit_keeps_looking_at_it(bench: Bench, parts: Parts) -> None:
    for write in (1, 2):
        bench.station.judged.take(worse(write))
    parts.edits.refresh()
    assert parts.edits.list.currentRow() == 0
    parts.edits.list.setCurrentRow(1)
    bench.station.judged.take(told(3))
    parts.edits.refresh()
    assert parts.edits.list.currentRow() == 2
    assert parts.edits.list.count() == 3


@pytest.mark.parametrize("word", [Word.FEW, Word.WORSE, None])
def test_a_trial_that_counts_down_says_what_it_does_so_far(
    bench: Bench, parts: Parts, word: Word | None
) -> None:
    said = {
        Word.FEW: "too early to judge it: 49 gait cycles before, 3 since; it takes 8 of each leg, before and",
        Word.WORSE: "so far worse: left knee tracking error RMS +19.2 %",
        None: "once the wearer walks",
    }
    bench.station.writing.trial = Trial(
        1, {"gait.step_length": 0.4}, {"gait.step_length": 0.3}, time.monotonic_ns() + 10**10
    )
    if word is not None:
        known = worse(is_final=False)
        cycles = 3 if word is Word.FEW else known.evidence.cycles_after
        found = replace(known.evidence, word=word, cycles_after=cycles)
        bench.station.judged.take(replace(known, evidence=found))
    parts.trial.refresh()
    assert said[word] in parts.trial.words.text()


def test_of_somebody_who_walks_a_new_trial_is_not_judged_yet(bench: Bench, parts: Parts) -> None:
    bench.station.writing.trial = Trial(
        1, {"gait.step_length": 0.4}, {"gait.step_length": 0.3}, time.monotonic_ns() + 10**10
    )
    bench.look_again([walking(1000), looked()])
    assert bench.station.processing.derived().gait.walking
    parts.trial.refresh()
    assert "not judged yet" in parts.trial.words.text()
    assert "once the wearer walks" not in parts.trial.words.text()


@pytest.mark.parametrize(
    ("left_out", "notes", "said"),
    [
        (
            {"left_knee: it reports a fault": 3, "left_knee: values are missing": 40},
            (),
            "40 gait cycles left",
        ),
        ({}, ("strides lasted 1.2 s before and 1.6 s after",), "strides lasted"),
        ({}, (), "too few strides before and after are comparable"),
    ],
)
def test_enough_strides_that_cannot_be_judged_say_why(
    bench: Bench, parts: Parts, left_out: dict[str, int], notes: tuple[str, ...], said: str
) -> None:
    bench.station.writing.trial = Trial(
        1, {"gait.step_length": 0.4}, {"gait.step_length": 0.3}, time.monotonic_ns() + 10**10
    )
    known = worse(is_final=False)
    found = replace(known.evidence, word=Word.FEW, left_out=left_out, notes=notes)
    bench.station.judged.take(replace(known, evidence=found))
    parts.trial.refresh()
    assert f"cannot be judged so far: {said}" in parts.trial.words.text()


def test_an_edit_stands_at_the_time_of_this_place(
    bench: Bench, parts: Parts, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As all else in the window, and not in UTC."""
    monkeypatch.setenv("TZ", "UTC-05:30")  # east of it, as POSIX writes that
    time.tzset()
    try:
        known = worse()
        edit = replace(known.edit, utc_ns=1_700_000_000 * 10**9)
        note = f"the edit of gait.step_length at {edit.utc} (9f1b194352) leaves fewer cycles before this one"
        noted = replace(known.evidence, notes=(note,))
        bench.station.judged.take(replace(known, edit=edit, evidence=noted))
        parts.edits.refresh()
        words = parts.edits.words.text()
    finally:
        monkeypatch.undo()
        time.tzset()
    assert parts.edits.list.item(0).text().startswith("2023-11-15 03:43  ")
    assert "The edit of gait.step_length at 2023-11-15 03:43 leaves fewer cycles" in words


def test_evidence_that_grows_lays_no_other_edit_out_again(bench: Bench, parts: Parts) -> None:
    for write in (1, 2):
        bench.station.judged.take(worse(write, is_final=False))
    parts.edits.refresh()
    items = [parts.edits.list.item(row) for row in (0, 1)]
    bench.station.judged.take(worse(2))
    parts.edits.refresh()
    assert [parts.edits.list.item(row) for row in (0, 1)] == items
    assert ["so far" in item.text() for item in items] == [False, True]
    assert "so far" not in parts.edits.verdict.text()


def running(write: int, state: EditState = EditState.ON_TRIAL) -> EditEvidence:
    """A trial, as evidence of it grows."""
    known = worse(write, is_final=False)
    return replace(known, edit=replace(known.edit, state=state))


def test_a_trial_that_begins_is_looked_at_until_somebody_chooses_another(bench: Bench, parts: Parts) -> None:
    chosen = parts.edits.list
    for write in (1, 2):
        bench.station.judged.take(worse(write))
    parts.edits.refresh()
    chosen.setCurrentRow(1)
    bench.station.judged.take(running(3))
    parts.edits.refresh()
    assert chosen.currentRow() == 0
    assert "on trial · worse so far" in chosen.item(0).text()
    chosen.setCurrentRow(2)
    bench.station.judged.take(replace(running(3), curves=()))
    parts.edits.refresh()
    assert chosen.currentRow() == 2, "who chose it after the trial had begun keeps looking at it"


def test_a_trial_of_another_day_that_nobody_saw_end_is_not_looked_at(bench: Bench, parts: Parts) -> None:
    old = replace(running(1), is_final=True)
    bench.station.judged.take(old)
    bench.station.judged.take(worse(2))
    parts.edits.refresh()
    assert parts.edits.list.currentRow() == 0, "the newest one"


def test_what_has_ended_is_told_as_over_and_its_later_strides_as_such(bench: Bench, parts: Parts) -> None:
    known = running(1, EditState.REVERTED)
    counts = replace(known.evidence, cycles_before=49, cycles_after=41, cycles_back=9)
    bench.station.judged.take(replace(known, evidence=counts))
    parts.edits.refresh()
    assert parts.edits.list.item(0).text().endswith("taken back · was worse")
    said = parts.edits.verdict.text()
    assert said.endswith("was worse (41 gait cycles with it, 40 before it, 9 since it was taken back)")
    assert "grey: the old value, also since it was taken back" in parts.edits._legend.text()


def test_strides_are_read_where_the_pointer_is(bench: Bench, parts: Parts) -> None:
    bench.station.judged.take(worse())
    parts.edits.refresh()
    QApplication.processEvents()  # what has come to a layout is shown then
    parts.edits.grab()  # only what is drawn has a place for each value
    knee = parts.edits.curves["left_knee.position"]
    where = QPointF(knee._area.center())
    none, no_keys = Qt.MouseButton.NoButton, Qt.KeyboardModifier.NoModifier
    QApplication.sendEvent(knee, QMouseEvent(QEvent.Type.MouseMove, where, where, none, none, no_keys))
    assert {one.read for one in parts.edits.curves.values()} == {"50 %: 5.7 → 11.5 °"}
    QApplication.sendEvent(knee, QEvent(QEvent.Type.Leave))
    assert knee.read == ""


def test_a_note_that_names_no_time_at_all_stays_as_it_was_written() -> None:
    wrong = "compared with 2026-13-41T25:00:00Z (ab12), which overlaps"
    assert _by_our_clock(wrong) == wrong
    assert "Z (ab12)" not in _by_our_clock("compared with 2026-11-03T14:20:00Z (ab12), which overlaps")


def test_a_trial_with_too_few_strides_is_tried_again_by_way_of_the_review(
    bench: Bench, window: MainWindow
) -> None:
    bench.look_again([looked()])
    page = window.tabs.edits
    one = worse(is_final=True)
    edit = replace(
        one.edit, changes=(ParameterChange("gait.step_length", 0.4, 0.43),), state=EditState.REVERTED
    )
    for word in (Word.WORSE, Word.FEW):
        few = Curves("left_knee.position", Side((0.1,) * 101, (0.01,) * 101, 40), None)
        found = replace(one, edit=edit, evidence=replace(one.evidence, word=word), curves=(few,))
        bench.station.judged.take(found)
        page.refresh()
        assert page.try_again.isHidden() is (word is Word.WORSE)
    page.try_again.click()
    assert {name: one.value for name, one in bench.station.edits.staged.items()} == {"gait.step_length": 0.43}
    assert [change.new for change in window.parameters.review.changes] == [0.43]
    assert bench.first.named("write") == []
    page.refresh()
    assert page.try_again.isHidden(), "staged already"


def test_strides_that_are_too_few_are_dashed_and_said_to_be(bench: Bench, parts: Parts) -> None:
    one = worse()
    for count in (8, 7):
        after = Side((0.2,) * 101, (0.01,) * 101, count)
        curves = tuple(Curves(each.channel, each.before, after) for each in one.curves)
        bench.station.judged.take(replace(one, curves=curves))
        parts.edits.refresh()
        assert ("dashed: fewer than 8 strides" in parts.edits._legend.text()) is (count < 8)


def test_the_legend_speaks_of_no_curve_that_is_not_drawn(bench: Bench, parts: Parts) -> None:
    one = worse()
    for before, after, words in (
        (1, 1, "blue: the new value · grey: the old value ·"),
        (0, 1, "blue: the new value · too few strides with the old value to draw"),
    ):
        curves = tuple(
            Curves(each.channel, each.before if before else None, each.after if after else None)
            for each in one.curves
        )
        bench.station.judged.take(replace(one, curves=curves))
        parts.edits.refresh()
        assert words in parts.edits._legend.text()
