"""What the panel of parameters shows within the window: of which robot, at which width, of which trial."""

import time

import pytest
from PySide6.QtCore import Qt

from gateway.client import ConnectionState, NotConnected
from gateway.wire.parameter import Confirmed, Written
from server_gui.core.follow.events import LinkChanged
from server_gui.views.frame.main_window import MainWindow
from server_gui.views.parameters.panel import ParametersPanel
from tests.gui.fakes import Bench
from tests.support.desk import described, looked


@pytest.mark.parametrize("way", ["another robot", "it lacks it", "none is left"])
def test_a_card_shows_no_value_of_another_robot(window: MainWindow, bench: Bench, way: str) -> None:
    bench.look_again([looked()])
    detail = window.parameters.detail
    window.parameters.tree.select_name("gait.step_length")
    bench.draw(window)
    assert detail.field.text() == "400"
    assert detail.slider.value() > 0
    if way == "none is left":
        bench.desk.remove(bench.station)
    else:
        other = bench.add("exo-02", 7421)
        if way == "it lacks it":
            other.take([described("exo-02", parameters={})])
        bench.desk.select(other)
    bench.draw(window)
    detail.refresh()
    assert (detail.field.text(), detail._unit.text(), detail.slider.value()) == ("", "", 0)
    assert "400" not in detail._facts.text()
    assert detail.range.figures == ("", "")


def test_while_a_value_is_read_again_no_slider_tells_one(panel: ParametersPanel, bench: Bench) -> None:
    bench.look_again([looked()])
    panel.tree.select_name("gait.step_length")
    panel.refresh()
    assert panel.detail.slider.isEnabled()
    bench.station.reverted.began({"gait.step_length": 0.4})
    panel.refresh()
    assert not panel.detail.slider.isEnabled()
    assert panel.detail.slider.value() == 0


@pytest.mark.parametrize(("ask", "said"), [("keep", "NOT kept"), ("take_back", "NOT taken back")])
def test_what_is_not_done_with_a_trial_is_said_where_it_counts_down(
    window: MainWindow, bench: Bench, ask: str, said: str
) -> None:
    bench.look_again([looked()])
    bench.station.writing.done(
        Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=20.0)
    )
    bench.draw(window)
    now = window.tabs.overview.now
    for is_away in (False, True):
        getattr(window.parameters.trial, ask).emit()
        bench.first.futures[-1].set_exception(NotConnected("the link is lost"))
        bench.draw(window)
        words = now.trial.detail.text() if is_away else window.parameters.trial.words.text()
        assert f"{said}; taken back in" in words
        assert bench.station.writing.trial is not None
        window._panels.put_away()
        bench.draw(window)
    bench.station.writing.kept()
    bench.station.writing.done(
        Written(8, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=20.0)
    )
    assert not bench.station.writing.failed_ask, "it was of another one"


def test_a_trial_whose_end_nobody_sees_is_not_said_to_be_read(window: MainWindow, bench: Bench) -> None:
    bench.look_again([looked()])
    bench.station.writing.done(Written(7, {"gait.step_length": 0.4}, {"gait.step_length": 0.43}, trial_s=0.0))
    bench.station.take([LinkChanged(ConnectionState.WAITING, "gone", time.monotonic_ns())])
    bench.draw(window)
    assert "its time is over: not known, no link" in window.parameters.trial.words.text()


@pytest.mark.parametrize("width", range(310, 500, 20))
def test_what_writes_is_whole_in_a_review_of_any_width(window: MainWindow, bench: Bench, width: int) -> None:
    window.resize(1366, 768)
    bench.look_again([looked()])
    window.parameters.stage_text("gait.step_length", "430")
    window.parameters.begin_review()
    review = window.parameters.review
    window.resizeDocks([window.docks[1]], [width], Qt.Orientation.Horizontal)
    bench.draw(window)
    room = review.parentWidget()
    assert room is not None
    assert review.width() <= room.width(), "it is scrolled to the side"
    for control in (review.try_it, review.seconds, review.write_it):
        assert control.width() >= control.minimumSizeHint().width()
        assert control.visibleRegion().boundingRect() == control.rect()


def test_a_late_answer_about_a_trial_is_none_about_the_next(panel: ParametersPanel, bench: Bench) -> None:
    """Trial 8 was called kept, with no way to keep it or take it back, as the answer about 7 came."""
    before, after = {"gait.step_length": 0.4}, {"gait.step_length": 0.43}
    writing = bench.station.writing
    writing.done(Written(7, before, after, trial_s=20.0))
    panel.trial.keep.emit()
    panel.trial.take_back.emit()
    keep, back = bench.first.futures[-2:]
    keep.set_exception(NotConnected("too late"))
    assert writing.failed_ask == "", "something else was asked since"
    back.set_exception(NotConnected("no link"))
    assert writing.failed_ask == "NOT taken back"
    panel.trial.keep.emit()
    panel.trial.keep.emit()
    late, failing = bench.first.futures[-2:]
    writing.done(Written(8, before, after, trial_s=20.0))
    assert writing.failed_ask == ""
    late.set_result(Confirmed(7, after))
    failing.set_exception(NotConnected("too late"))
    assert writing.trial is not None
    assert (writing.trial.write, writing.failed_ask) == (8, "")
