"""Closing the window: what it waits for is said, and whoever does not want to wait need not."""

import threading
import time
from collections.abc import Iterator
from typing import cast

import pytest
from PySide6.QtCore import QTimer
from PySide6.QtWidgets import QApplication

from server_gui.core.desk.feeds import Feeds
from server_gui.core.desk.shutdown import Shutdown
from server_gui.views.frame.closing import Closing, wait_closed
from server_gui.views.theme import Theme

LONG_S = 60.0


class SlowFeeds:
    """Its last upload takes a minute, unless it is hurried."""

    def __init__(self) -> None:
        self.ends, self.hangs = "3 batches of the recording go to the store", False
        self.hurried = threading.Event()

    def __exit__(self, *exc: object) -> None:
        self.hurried.wait(LONG_S)

    def hurry(self) -> None:
        self.hurried.set()


@pytest.fixture
def feeds() -> Iterator[SlowFeeds]:
    made = SlowFeeds()
    yield made
    made.hurry()


def dialog() -> Closing | None:
    shown = (one for one in QApplication.topLevelWidgets() if isinstance(one, Closing) and one.isVisible())
    return next(shown, None)


def test_within_half_a_second_it_is_said_what_is_waited_for_and_closing_that_waits_no_more(
    theme: Theme, feeds: SlowFeeds
) -> None:
    last: list[str] = []
    ending = Shutdown(cast("Feeds", feeds), lambda _within_s: True, lambda: last.append("robot"))
    said: list[tuple[float, str]] = []
    began_s = time.monotonic()

    def close_again() -> None:
        if (shown := dialog()) is not None:
            said.append((time.monotonic() - began_s, shown.said.text()))
            shown.close()

    looking = QTimer(interval=10)
    looking.timeout.connect(close_again)
    looking.start()
    ending.begin()
    wait_closed(ending, theme)
    looking.stop()
    assert said[0][1].startswith("3 batches of the recording go to the store … (")
    assert said[0][0] < LONG_S / 2, "it was said when it was over"
    assert ending.is_over
    ending.finish()
    assert (last, ending.hangs, dialog()) == (["robot"], False, None)


def test_what_ends_at_once_is_not_worth_a_word(theme: Theme, feeds: SlowFeeds) -> None:
    feeds.hurry()
    ending = Shutdown(cast("Feeds", feeds), lambda _within_s: True, lambda: None)
    ending.begin()
    wait_closed(ending, theme)
    ending.finish()
    assert not ending.hangs


def test_what_hangs_although_it_was_hurried_is_left_to_the_end_of_the_process(
    theme: Theme, feeds: SlowFeeds, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("server_gui.views.frame.closing.HURRIED_S", 0.05)
    stuck = threading.Event()

    def hang() -> None:
        stuck.wait(LONG_S)

    ending = Shutdown(cast("Feeds", feeds), lambda _within_s: True, hang)
    ending.begin()
    ending.hurry()
    wait_closed(ending, theme)
    ending.finish()
    assert ending.hangs
    stuck.set()
    assert ending.wait(LONG_S)
    ending.finish()


def test_a_store_that_hangs_is_given_up_at_once_when_hurried(feeds: SlowFeeds) -> None:
    feeds.hurry()
    ending = Shutdown(cast("Feeds", feeds), lambda _within_s: False, lambda: None)
    ending.begin()
    ending.hurry()
    assert ending.wait(LONG_S)
    assert ending.hangs, "the process is what ends it"
    ending.finish()
