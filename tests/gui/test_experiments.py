"""A/B trials and sweeps in the window: begun from the page of edits, ended from the bar, told on the page."""

import math

import pytest
from msgspec.structs import replace

from gateway.wire.parameter import Reverted, Written
from server_gui.core.evidence.comparison import Evidence, Word
from server_gui.core.evidence.experiment import Experiment, Period, Point, Response
from server_gui.core.evidence.file import EditEvidence
from server_gui.core.experiments.machine import Event, ExperimentState
from server_gui.core.tuning.commands import ReadBack
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.panel import ParametersPanel
from tests.gui.fakes import Bench, Parts
from tests.gui.rules import settle
from tests.gui.running import wait
from tests.support.desk import looked
from tests.unit.evidence.test_file import told

NAME = "gait.step_length"


def swept() -> EditEvidence:
    """A sweep whose second value is the best."""
    points = tuple(
        Point(value, 6, mean, mean - 0.0002, mean + 0.0002)
        for value, mean in ((2800.0, 0.0050), (3000.0, 0.0047), (3200.0, 0.0041))
    )
    title = "left_knee tracking error RMS"
    response = Response("left_knee.error_rms", title, "rad", points)
    periods = tuple(Period(point.value, 7 + place, 0, 1, 6) for place, point in enumerate(points))
    tried = Experiment(
        kind="sweep",
        parameter="left_knee.position_gain",
        unit="N·m/rad",
        original=3000.0,
        values=(2800.0, 3000.0, 3200.0),
        cycles=6,
        transient=2,
        seconds=None,
        seed=None,
        periods=periods,
        ended="",
        is_back=True,
        back="the original value is back",
        responses=(response,),
        judged_by="left_knee.error_rms",
        proposal=3200.0,
        reason="least left_knee tracking error RMS",
    )
    found = Evidence(Word.CHANGED, "", (), 0, 18)
    return replace(told(), evidence=found, experiment=tried, curves=())


def begun(bench: Bench, parts: Parts) -> None:
    """An A/B trial of two step lengths."""
    bench.station.take([looked()])
    edits = parts.edits
    edits.refresh()
    edits.ab.click()
    form = edits.form
    form.parameter.setCurrentText(NAME)
    form.fields["B"].setText("420")
    assert form.begin.isEnabled(), form.words.text()
    assert "10 pairs of 400 mm (A) and 420 mm (B)" in form.words.text()
    form.begin.click()


def test_the_form_says_what_it_will_do_and_what_cannot_be(bench: Bench, parts: Parts) -> None:
    bench.station.take([looked()])
    parts.edits.refresh()
    parts.edits.ab.click()
    form = parts.edits.form
    form.parameter.setCurrentText(NAME)
    assert not form.begin.isEnabled()
    assert form.words.text() == "B: type a number."
    form.fields["B"].setText("900")
    assert "largest allowed" in form.words.text()
    form.reject()


def test_stop_and_take_back_is_in_sight_until_it_was_read_back(
    bench: Bench, parts: Parts, panel: ParametersPanel
) -> None:
    begun(bench, parts)
    run = bench.station.experiment
    assert run is not None
    run._do(Event.READY)
    bench.first.answer(Written(5, {NAME: 0.4}, {NAME: 0.4}, 40.0))
    parts.experiment.refresh()
    assert parts.experiment.isVisible()
    assert "back by itself in" in parts.experiment.words.text()
    panel.refresh()
    assert "a write of yours ends it" in panel.banner.text()
    part = told(5)
    bench.station.judged.take(replace(part, edit=replace(part.edit, boot_id=run.boot_id)))
    parts.edits.refresh()
    assert parts.edits.list.count() == 0
    parts.experiment.end.click()
    assert bench.first.named("revert") == [(5,)]
    assert run.state is ExperimentState.TAKING_BACK
    bench.first.answer(Reverted(5, {NAME: "taken back"}))
    parts.experiment.refresh()
    assert bench.first.named("read_back") == [(NAME,)]
    bench.first.answer(ReadBack(0.4, None, on_trial=False))
    parts.experiment.refresh()
    assert "the original value is back" in parts.experiment.words.text()
    assert "ended early: asked for" in parts.experiment.words.text()
    parts.edits.refresh()
    assert parts.edits.list.count() == 1
    assert "A/B" in parts.edits.list.item(0).text()
    parts.experiment.end.click()
    assert not parts.experiment.isVisible()


def test_from_a_trials_bar_both_of_its_values_are_asked_about(bench: Bench, window: MainWindow) -> None:
    bench.station.take([looked()])
    bench.station.writing.done(Written(7, {NAME: 0.4}, {NAME: 0.42}, 40.0))
    window.trial.refresh()
    window.trial.ab.click()
    form = window.tabs.edits.form
    assert bench.first.named("revert") == [(7,)]
    assert [field.text() for field in form.fields.values()] == ["400", "420"]
    assert "on trial" in form.words.text()
    assert not form.begin.isEnabled()
    bench.first.answer(Reverted(7, {NAME: "taken back"}))
    bench.station.take([looked({NAME: 0.4})])
    wait(form.begin.isEnabled, "it may begin")
    said = form.words.text()
    settle()
    assert form.parameter.height() >= form.parameter.sizeHint().height(), "fields are not pressed together"
    form.begin.click()
    run = bench.station.experiment
    assert run is not None
    assert f"seed {run.plan.seed}" in said, "what was said is what is begun"


def test_the_form_begins_with_the_edit_that_is_looked_at(bench: Bench, parts: Parts) -> None:
    bench.station.take([looked()])
    (change,) = told().edit.changes
    edit = replace(told().edit, changes=(replace(change, name=NAME, old=0.4, new=0.42),))
    bench.station.judged.take(replace(told(), edit=edit))
    parts.edits.refresh()
    parts.edits.ab.click()
    form = parts.edits.form
    assert form.parameter.currentText() == NAME
    assert [field.text() for field in form.fields.values()] == ["400", "420"]
    form.reject()
    parts.edits.sweep.click()
    assert parts.edits.form.parameter.currentText() == NAME
    assert parts.edits.form.fields["From"].text() == "400"
    parts.edits.form.reject()


def test_bounds_are_in_the_units_of_the_window(bench: Bench, parts: Parts) -> None:
    bench.station.take([looked()])
    parts.edits.refresh()
    parts.edits.ab.click()
    form = parts.edits.form
    form.parameter.setCurrentText(NAME)
    form.fields["B"].setText("420")
    assert form.error.accessibleName() == "Most tracking error (°)"
    form.error.setText("2")
    assert form.plan.bounds.error == pytest.approx(math.radians(2.0))
    form.error.setText("-2")
    assert "a number above 0" in form.words.text()
    form.reject()


def test_a_trial_of_several_parameters_is_no_ab_trial(bench: Bench, parts: Parts) -> None:
    several = {NAME: 0.4, "gait.cycle_time": 2.0}
    bench.station.writing.done(Written(7, several, several, 40.0))
    parts.trial.refresh()
    assert parts.trial.isVisible()
    assert parts.trial.ab.isVisible()
    assert not parts.trial.ab.isEnabled()
    assert "of one parameter, and 2 are on trial" in parts.trial.ab.toolTip()
    parts.edits.compare(bench.station)
    assert not bench.first.named("revert")


def test_a_second_one_is_refused_while_one_goes_on(bench: Bench, parts: Parts) -> None:
    begun(bench, parts)
    parts.edits.ab.click()
    parts.edits.form.parameter.setCurrentText(NAME)
    parts.edits.form.fields["B"].setText("430")
    parts.edits.form.begin.click()
    assert "goes on" in parts.edits.form.words.text()


@pytest.mark.parametrize("is_back", [True, False])
def test_a_sweep_is_told_with_its_response_and_without_its_parts(
    bench: Bench, parts: Parts, is_back: bool
) -> None:
    one = swept()
    assert one.experiment is not None
    one = replace(one, experiment=replace(one.experiment, is_back=is_back))
    for write in (7, 8, 9):
        part = told(write)
        bench.station.judged.take(replace(part, edit=replace(part.edit, boot_id=one.edit.boot_id)))
    bench.station.judged.take(replace(one, edit=replace(one.edit, id="ffff")))
    parts.edits.refresh()
    assert parts.edits.list.count() == 1
    assert "sweep 2800 … 3200" in parts.edits.verdict.text()
    assert ("NOT CONFIRMED" in parts.edits.verdict.text()) is not is_back
    assert "proposal: 3200" in parts.edits.words.text()
    assert "3200: 0.2349" in parts.edits.response.accessibleDescription()
    parts.edits.response.grab()
