"""The thread that follows edits keeps what came of them where it records, and outlives mistakes."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from server_gui.core.evidence.file import EditEvidence, EvidenceFile, read_all
from server_gui.core.evidence.service import EvidenceService
from server_gui.core.follow.events import Event
from tests.support.waiting import until
from tests.unit.evidence.walks import SPEED, Edit, walk


@pytest.fixture(scope="module")
def events() -> list[Event]:
    """A few seconds of a walk with an edit."""
    return list(walk(4.0, seed=1, person=0, edits=[Edit(3.0, f"left_knee.{SPEED}", 2.0)]))


def test_what_an_edit_did_is_kept_when_the_desk_ends(tmp_path: Path, events: list[Event]) -> None:
    heard: list[EditEvidence] = []
    with EvidenceService(
        tmp_path, lambda _robot: "session-1", lambda _robot, told: heard.append(told)
    ) as service:
        for event in events:
            service.take("exo-01", event)
        until(lambda: bool(heard))
    (told,) = read_all(tmp_path)
    assert (told.session, told.edit.robot, told.edit.write) == ("session-1", "exo-01", 3)


def test_nothing_is_kept_of_a_robot_that_is_not_recorded(tmp_path: Path, events: list[Event]) -> None:
    heard: list[EditEvidence] = []
    with EvidenceService(tmp_path, lambda _robot: "", lambda _robot, told: heard.append(told)) as service:
        for event in events:
            service.take("exo-01", event)
        until(lambda: bool(heard))
    assert read_all(tmp_path) == []


def test_a_robot_that_sends_nonsense_disturbs_no_other(tmp_path: Path, events: list[Event]) -> None:
    def broken() -> Iterator[Event]:
        yield events[0]
        yield object()  # type: ignore[misc]  # nothing that a feed tells

    heard: list[EditEvidence] = []
    with EvidenceService(
        tmp_path, lambda _robot: "session-1", lambda _robot, told: heard.append(told)
    ) as service:
        for event in broken():
            service.take("exo-02", event)
        for event in events:
            service.take("exo-01", event)
        until(lambda: bool(heard))
    assert len(read_all(tmp_path)) == 1


def test_a_folder_that_cannot_be_written_is_said(
    tmp_path: Path, events: list[Event], caplog: pytest.LogCaptureFixture
) -> None:
    blocked = tmp_path / "edits"
    blocked.write_text("a file")
    heard: list[EditEvidence] = []
    with EvidenceService(
        blocked, lambda _robot: "session-1", lambda _robot, told: heard.append(told)
    ) as service:
        for event in events:
            service.take("exo-01", event)
        until(lambda: bool(heard))
    assert "is not kept" in caplog.text


def test_it_belongs_to_the_recording_in_which_the_edit_was_made(tmp_path: Path, events: list[Event]) -> None:
    """What is kept of a wearer goes with that wearer, and not with who came next."""
    heard: list[EditEvidence] = []
    session = ["anna"]
    with EvidenceService(
        tmp_path, lambda _robot: session[0], lambda _robot, told: heard.append(told)
    ) as service:
        for event in events:
            service.take("exo-01", event)
        until(lambda: bool(heard))
        session[0] = "bert"
    (told,) = read_all(tmp_path)
    assert told.session == "anna"


def test_what_a_command_keeps_meanwhile_is_told(
    tmp_path: Path, events: list[Event], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The window that records shows an A/B trial of a terminal."""
    monkeypatch.setattr("server_gui.core.evidence.service.LOOK_S", 0.0)
    heard: list[EditEvidence] = []
    with EvidenceService(tmp_path, lambda _robot: "", lambda _robot, told: heard.append(told)) as service:
        for event in events:
            service.take("exo-01", event)
        until(lambda: bool(heard))
        other = replace(heard[0], edit=replace(heard[0].edit, id="of a command"), is_final=True)
        EvidenceFile(tmp_path, "exo-01").add(other)
        until(lambda: other in heard)
    assert heard.count(other) == 1
