"""Journals that were collected: from store and spool, each entry once, and looked at for holes."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from msgspec.structs import replace

from gateway.records.journal import Journal, Sizes
from ml.store import Store, StoreError
from server_gui.core.archive import collected_journals as module
from server_gui.core.archive.collected_journals import KeptJournals, look
from server_gui.core.audit.chains import chained, journals, problem
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from server_gui.core.threads.background import Background
from tests.support.journals import RobotsJournal
from tests.support.waiting import WAIT_S, until


@pytest.fixture
def settings(tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path / "spool"))


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[RobotsJournal]:
    made = RobotsJournal(tmp_path)
    for number in range(6):
        made.say("stop", reason=f"stop {number}")
    yield made
    made.close()


def entries(journal: RobotsJournal) -> list[dict[str, Any]]:
    return [dict(entry) for entry in journal.told().journal.entries]


def collect(settings: ServerSettings, robot: str, found: list[dict[str, Any]], *, sent: bool = True) -> None:
    """These are collected of a robot, and go to the store or wait."""
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.journal(robot, found)
        for number in spool.waiting() if sent else ():
            send(spool, number, Store(settings.store.url))


def numbers(stretches: "list[list[dict[str, Any]]]") -> list[list[int]]:
    return [[entry["n"] for entry in stretch] for stretch in stretches]


def test_entries_of_two_places_are_one_journal_and_each_is_there_once(journal: RobotsJournal) -> None:
    found = entries(journal)
    assert numbers(chained([*found[3:], *found[:5]])) == [[1, 2, 3, 4, 5, 6]]
    holed = chained([*found[:2], *found[4:]])
    assert numbers(holed) == [[1, 2], [5, 6]]
    assert numbers(journals(holed)) == [[1, 2, 5, 6]]
    assert problem(holed) is None


def test_a_journal_that_was_begun_anew_is_another_one(journal: RobotsJournal, tmp_path: Path) -> None:
    (tmp_path / "anew").mkdir()
    other = RobotsJournal(tmp_path / "anew")
    other.say("stop", reason="anew")
    other.say("reset")
    found = chained([*entries(journal), *entries(other)])
    other.close()
    assert numbers(journals(found)) == [[1, 2, 3, 4, 5, 6], [1, 2]]
    assert problem(found) is None


def test_what_was_altered_shows_and_so_does_an_entry_that_is_there_in_two_versions(
    journal: RobotsJournal, tmp_path: Path
) -> None:
    altered = entries(journal)
    altered[2]["who"] = "nobody"
    assert problem(chained(altered)) == "line 3 was altered: its hash does not fit"
    (tmp_path / "fork").mkdir()
    lines = (tmp_path / "journal.jsonl").read_bytes().splitlines(keepends=True)
    (tmp_path / "fork" / "journal.jsonl").write_bytes(b"".join(lines[:3]))
    fork = RobotsJournal(tmp_path / "fork")
    fork.say("stop", reason="written over the fourth")
    both = chained([*entries(journal), *entries(fork)])
    fork.close()
    assert problem(both) == "entry 4 is there in two versions"


def test_entries_of_several_pieces_hold_together(tmp_path: Path) -> None:
    (tmp_path / "pieces").mkdir()
    journal = Journal(tmp_path / "pieces" / "journal.jsonl", "boot", sizes=Sizes(piece=2000))
    for _ in range(40):
        journal.append("tester", "note").result(WAIT_S)
    known = [entry for count in (40, 20, 5) for entry in journal.tail(count).result(WAIT_S).entries]
    journal.close()
    assert len(list((tmp_path / "pieces").glob("journal.jsonl.0*"))) > 3
    (stretch,) = chained(known)
    assert [entry["n"] for entry in stretch] == list(range(1, 41))
    assert problem([stretch]) is None


@pytest.mark.parametrize("sent", [True, False])
def test_what_store_and_spool_have_of_each_robot_is_found_and_looked_at(
    settings: ServerSettings, journal: RobotsJournal, tmp_path: Path, sent: bool
) -> None:
    found = entries(journal)
    another = replace(settings, recorder=replace(settings.recorder, spool=tmp_path / "another"))
    collect(another, "exo-01", found[1:4])  # by another collector, which saw some of the same
    collect(settings, "exo-01", found, sent=sent)
    collect(settings, "exo-02", found[:2], sent=sent)
    kept = look(settings)
    assert kept.problem is None
    assert [list(kept.by_robot), numbers(list(kept.by_robot["exo-01"].stretches))] == [
        ["exo-01", "exo-02"],
        [[1, 2, 3, 4, 5, 6]],
    ]
    assert kept.by_robot["exo-02"].verdict == "collected were 2 entries, unaltered, without a hole"


def test_of_a_long_journal_the_newest_are_read(
    settings: ServerSettings, journal: RobotsJournal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "KEPT", 2)
    collect(settings, "exo-01", entries(journal))
    assert numbers(list(look(settings).by_robot["exo-01"].stretches)) == [[5, 6]]


def test_the_newest_are_those_that_came_last_whatever_the_robots_clock_says(
    settings: ServerSettings, journal: RobotsJournal, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "KEPT", 2)
    found = entries(journal)
    collect(settings, "exo-01", found[:4])
    for entry in found[4:]:  # not told from an altered one here: only which are read counts
        entry["utc_ns"] -= 3_600 * 10**9
    collect(settings, "exo-01", found[4:])
    assert numbers(list(look(settings).by_robot["exo-01"].stretches)) == [[5, 6]]


def test_a_store_that_is_away_is_told_and_what_was_read_stays(
    settings: ServerSettings, journal: RobotsJournal, monkeypatch: pytest.MonkeyPatch
) -> None:
    collect(settings, "exo-01", entries(journal))
    background = Background("test")
    kept = KeptJournals(settings, background.do, lambda call: call())
    kept.look()
    until(lambda: kept.revision == 1)
    monkeypatch.setattr(module, "LOOK_S", 0.0)

    def away(url: str | None = None) -> Store:
        raise StoreError("s3://lab cannot be reached: Connection refused")

    monkeypatch.setattr(Store, "existing", away)
    kept.look()
    until(lambda: kept.revision == 2)
    assert kept.found.problem == "s3://lab cannot be reached: Connection refused"
    assert list(kept.found.by_robot) == ["exo-01"]
    assert background.close(30.0)


def test_where_there_is_no_store_yet_there_is_nothing(settings: ServerSettings) -> None:
    assert look(settings) == module.JournalsFound()
