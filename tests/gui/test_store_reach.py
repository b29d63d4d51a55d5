"""Whether the store is reached is decided once: what the newest look said, and how uploading goes."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from server_gui.core.alarms.texts import Kind
from server_gui.core.archive import library
from server_gui.core.archive.archive import Archive
from server_gui.core.archive.library import Library, Listing
from server_gui.core.cloud.store_reach import AGAIN_S, KNOWN_S, LOOK_S, Reach, StoreReach
from server_gui.core.desk.desk import Desk
from server_gui.core.desk.recording import By, Recording
from server_gui.core.follow.news import NewsKind
from server_gui.core.settings.server_file import ServerSettings
from tests.gui.fakes import Bench
from tests.gui.test_recording import AWAY, FakeKeeper, looked, report, settled
from tests.support.waiting import WAIT_S, until
from tests.unit.cloud.recordings import record

DAMAGED = "file:///lab/sessions has files and no _delta_log"


class Clock:
    """Time that a test lets pass."""

    def __init__(self) -> None:
        self.now_s = 100.0

    def __call__(self) -> float:
        return self.now_s


def test_a_store_that_nobody_has_looked_at_or_not_for_long_is_not_known() -> None:
    clock = Clock()
    reach = StoreReach(clock)
    assert (reach.state, reach.is_known, reach.is_due) == (Reach.NOT_LOOKED, False, True)
    reach.looked(None)
    assert (reach.state, reach.is_known, reach.is_due) == (Reach.REACHED, True, False)
    clock.now_s += LOOK_S
    assert reach.is_due
    clock.now_s += KNOWN_S
    assert (reach.state, reach.is_known) == (Reach.OLD, False)


def test_a_store_that_was_away_stays_so_until_a_look_says_otherwise() -> None:
    clock, back = Clock(), list[str]()
    reach = StoreReach(clock)
    reach.on_return.append(lambda: back.append("back"))
    reach.looked(AWAY)
    clock.now_s += 10 * KNOWN_S
    assert (reach.state, reach.trouble) == (Reach.AWAY, AWAY)
    reach.looked(AWAY)
    clock.now_s += AGAIN_S
    assert reach.is_due
    reach.looked(None)
    clock.now_s += AGAIN_S
    assert not reach.is_due
    assert (reach.state, reach.trouble, back) == (Reach.REACHED, None, ["back"])
    reach.looked(None)
    assert back == ["back"]


def test_an_upload_that_fails_is_no_reached_store_and_asks_for_a_look() -> None:
    reach = StoreReach(Clock())
    reach.looked(None)
    reach.uploads(AWAY)
    assert (reach.state, reach.trouble, reach.is_due) == (Reach.FAILING, AWAY, True)
    reach.looked(None)
    assert (reach.state, reach.is_due) == (Reach.FAILING, False), "the upload has not succeeded yet"
    reach.uploads(None)
    assert (reach.state, reach.is_due) == (Reach.REACHED, True)


def test_a_look_that_fails_is_an_alarm_before_any_upload_fails_and_is_over_with_the_next_that_succeeds() -> (
    None
):
    keeper, reach = FakeKeeper(report()), StoreReach(Clock())
    recording, news = looked(keeper)
    recording.rely_on(reach)
    reach.looked(AWAY)
    (told,) = (one.alarm for one in recording.alarms.active)
    assert (told.kind, told.what) == (Kind.UPLOAD, AWAY)
    said = recording.said(None)
    assert "store not reached" in said.text
    assert said.detail.startswith(AWAY)
    reach.looked(None)
    assert not recording.alarms.active
    assert "store not reached" not in recording.said(None).text
    assert keeper.asked == []
    assert not news.items


def test_what_waits_is_uploaded_as_soon_as_the_store_is_back() -> None:
    keeper, reach = FakeKeeper(report(problem=AWAY, waiting=3)), StoreReach(Clock())
    recording, _ = looked(keeper)
    recording.rely_on(reach)
    reach.uploads(AWAY)
    reach.looked(AWAY)
    assert keeper.asked == []
    reach.looked(None)
    assert keeper.asked == ["upload"]
    assert recording.alarms.active, "until the upload has succeeded"


def test_one_keeper_is_asked_once_however_often_its_recording_is_set_and_a_replaced_one_not_at_all() -> None:
    desk = Desk()
    old, new = (FakeKeeper(report(problem=AWAY, waiting=3)) for _ in range(2))
    recording, replacing = looked(old)[0], looked(new)[0]

    def away_and_back() -> None:
        desk.reach.looked(AWAY)
        desk.reach.looked(None)

    for _ in range(2):
        desk.recording = recording
    away_and_back()
    assert (old.asked, len(recording.on_mark)) == (["upload"], 1)
    desk.recording = replacing
    away_and_back()
    assert (old.asked, new.asked) == (["upload"], ["upload"])
    assert (len(recording.on_mark), len(replacing.on_mark)) == (0, 1)
    recording._reported(old, report(problem="of the replaced one"))
    assert desk.reach.upload_problem is None


def test_an_upload_to_a_store_that_is_back_says_why_it_was_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    keeper, reach = FakeKeeper(report(problem=AWAY, waiting=3)), StoreReach(Clock())
    recording, news = looked(keeper)
    recording.rely_on(reach)
    refused = OSError("its door is shut")
    monkeypatch.setattr(keeper, "upload", lambda: settled(refused))
    reach.looked(AWAY)
    reach.looked(None)
    assert next(item.text for item in news.items if item.kind is NewsKind.WARNING) == "its door is shut"


def test_a_list_that_cannot_be_read_stays_told_until_it_was_read_and_is_no_store_that_was_away() -> None:
    reach, back = StoreReach(Clock()), list[str]()
    reach.on_return.append(lambda: back.append("back"))
    reach.listed(DAMAGED)
    for _ in range(2):
        reach.looked(None)
        assert (reach.state, reach.is_known, reach.trouble) == (Reach.UNREADABLE, False, DAMAGED)
    assert back == []
    reach.looked(AWAY)
    assert (reach.state, reach.trouble) == (Reach.AWAY, AWAY)
    reach.looked(None)
    assert (reach.state, back) == (Reach.UNREADABLE, ["back"])
    reach.listed(None)
    assert (reach.state, back) == (Reach.REACHED, ["back"])


def test_a_damaged_list_does_not_come_and_go_with_the_first_file_and_is_looked_at_without_a_page(
    settings: ServerSettings, tmp_path: Path, bench: Bench
) -> None:
    record(settings.store.url, settings.recorder.spool)
    log = tmp_path / "store" / "sessions" / "_delta_log"
    shutil.move(log, tmp_path / "log")
    archive, states, reach = (
        Archive(settings, bench.desk, lambda call: call()),
        list[Reach](),
        bench.desk.reach,
    )
    keeper = FakeKeeper(report())
    bench.desk.recording = Recording(By.WINDOW, keeper, lambda call: call(), bench.desk.news)

    def look() -> None:
        """As time passes with no page open that lists."""
        reach.looked_s, archive.library.looked_s = reach.looked_s and 0.0, archive.library.looked_s and 0.0
        archive.look()
        until(lambda: reach.looked_s)
        states.append(reach.state)

    for _ in range(4):
        look()
    assert states == [Reach.REACHED, *[Reach.UNREADABLE] * 3]
    assert "_delta_log" in reach.said
    assert keeper.asked == []
    shutil.move(tmp_path / "log", log)
    look()
    assert reach.state is Reach.REACHED
    assert archive.close(WAIT_S)


def test_a_knock_sees_a_folder_that_has_gone_and_that_is_back(
    settings: ServerSettings, tmp_path: Path
) -> None:
    empty = library.knock(settings)
    assert (empty.problem, empty.is_empty) == (None, True)
    record(settings.store.url, settings.recorder.spool)
    shutil.move(tmp_path / "store", tmp_path / "away")
    looking = Library(settings, lambda call: call())
    looking.knock()
    until(lambda: looking.reach.looked_s)
    assert looking.reach.state is Reach.AWAY
    assert "any more" in looking.reach.said
    shutil.move(tmp_path / "away", tmp_path / "store")
    looking.reach.uploads(AWAY)
    looking.reach.uploads(None)
    looking.knock()
    until(lambda: looking.reach.state is Reach.REACHED)
    assert looking.revision == 0, "nothing was listed"
    assert looking.close(WAIT_S)


def test_a_knock_that_is_asked_for_while_another_one_is_under_way_is_made_after_it(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And of a list that is damaged no first file is asked."""
    made, came = list[str](), list[Callable[[], None]]()

    def seen(what: str, problem: str | None) -> Callable[[ServerSettings], Listing]:
        def look(_settings: ServerSettings) -> Listing:
            made.append(what)
            return Listing(problem=problem)

        return look

    monkeypatch.setattr(library, "knock", seen("knock", None))
    monkeypatch.setattr(library, "look", seen("look", DAMAGED))
    looking = Library(settings, came.append)
    for now in (True, True, False):
        looking.knock(now=now)
    until(lambda: came).pop()()
    until(lambda: came).pop()()
    assert made == ["knock", "knock"]
    looking.reach.listed(DAMAGED)
    looking.knock(now=True)
    until(lambda: came).pop()()
    assert (made[2:], looking.reach.state) == (["look"], Reach.UNREADABLE)
    assert looking.close(WAIT_S)


def test_of_a_look_that_fails_by_a_mistake_of_ours_the_store_is_not_called_reached(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails(_settings: ServerSettings) -> Listing:
        raise KeyError("a mistake of ours")

    monkeypatch.setattr(library, "look", fails)
    looking = Library(settings, lambda call: call())
    looking.look(now=True)
    until(lambda: looking.looked_s)
    assert looking.reach.state is Reach.AWAY
    assert looking.close(WAIT_S)
