"""Labels of the session that is played: given, refused and taken back without waiting for the store."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path
from typing import Any

import msgspec
import pytest

from ml.store import StoreUnreachable
from server_gui.core.archive.labelling import Labelling
from server_gui.core.archive.labels import SessionLabels
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from tests.unit.labelling.test_labelling import BEGAN, SESSION, S, manual, recorded


class Later:
    """Work that is done when the test says so, as another thread would."""

    def __init__(self) -> None:
        self._waiting: list[tuple[Future[Any], Callable[[], Any]]] = []

    def __call__(self, work: Callable[[], Any]) -> "Future[Any]":
        self._waiting.append((Future(), work))
        return self._waiting[-1][0]

    def go_on(self) -> None:
        while self._waiting:
            self.one()

    def one(self) -> None:
        future, work = self._waiting.pop(0)
        try:
            future.set_result(work())
        except Exception as error:  # noqa: BLE001 - as an executor does
            future.set_exception(error)


@pytest.fixture
def settings(tmp_path: Path, folder_url: str) -> ServerSettings:
    made = ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path / "spool"))
    recorded(made)
    return made


@pytest.fixture
def later() -> Later:
    return Later()


@pytest.fixture
def labels(settings: ServerSettings, later: Later) -> SessionLabels:
    return of(settings, later)


def of(settings: ServerSettings, later: Later) -> SessionLabels:
    made = SessionLabels(settings, later, lambda call: call(), author="ada")
    made.open(Labelling(settings).session(SESSION))
    later.go_on()
    return made


def give(labels: SessionLabels, text: str, begin_s: int, end_s: int) -> None:
    labels.add(text, BEGAN + begin_s * S, BEGAN + end_s * S)


def found(labels: SessionLabels) -> list[str]:
    return [label.label for label in labels.labels]


def test_a_label_is_there_when_it_is_kept_and_not_before(labels: SessionLabels, later: Later) -> None:
    give(labels, " walk ", 10, 20)
    assert (labels.said, found(labels)) == ("…", [])
    later.go_on()
    assert (labels.said, found(labels)) == ("labelled: walk, in the store", ["walk"])
    give(labels, "walk", 10, 20)
    later.go_on()
    assert (labels.said, found(labels)) == ("labelled: walk: it was so already", ["walk"])


def test_what_waits_for_an_upload_is_said_to(settings: ServerSettings, later: Later) -> None:
    labels = of(manual(settings), later)
    give(labels, "walk", 10, 20)
    later.go_on()
    assert labels.said == "labelled: walk, safe here, goes to the store with the next upload"
    assert found(labels) == ["walk"]


def test_a_contradiction_is_refused_and_what_was_said_stays(labels: SessionLabels, later: Later) -> None:
    give(labels, "walk", 10, 20)
    give(labels, "sit", 15, 25)
    later.go_on()
    assert labels.failed
    assert "contradicts walk" in labels.said
    assert found(labels) == ["walk"]


def test_a_label_is_taken_back(labels: SessionLabels, later: Later) -> None:
    give(labels, "walk", 10, 20)
    later.go_on()
    labels.remove(labels.labels[0])
    later.go_on()
    assert (labels.said, found(labels)) == ("taken back: walk, in the store", [])


def test_a_store_that_does_not_answer_is_told_as_it_says_it(
    labels: SessionLabels, later: Later, monkeypatch: pytest.MonkeyPatch
) -> None:
    def unreachable(*_: object) -> None:
        raise StoreUnreachable("the store does not answer")

    monkeypatch.setattr(Labelling, "add_all", unreachable)
    give(labels, "walk", 10, 20)
    later.go_on()
    assert (labels.said, labels.failed, found(labels)) == ("the store does not answer", True, [])


def test_what_comes_late_of_another_session_is_not_shown(settings: ServerSettings, later: Later) -> None:
    labels = of(settings, later)
    give(labels, "walk", 10, 20)
    later.go_on()
    first = Labelling(settings).session(SESSION)
    labels.open(first)  # reading its labels takes until another one is looked at
    labels.open(msgspec.structs.replace(first, session="another"))
    later.one()
    assert found(labels) == []


def test_without_a_session_nothing_is_labelled(settings: ServerSettings, later: Later) -> None:
    labels = SessionLabels(settings, later, lambda call: call(), author="ada")
    give(labels, "walk", 10, 20)
    later.go_on()
    assert (labels.said, found(labels)) == ("", [])
