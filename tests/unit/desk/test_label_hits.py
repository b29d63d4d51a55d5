"""How right predictions of that time were: by labels of persons within a span."""

from concurrent.futures import Future
from types import SimpleNamespace
from typing import Any

import pytest

from ml.errors import UnusableModel
from ml.serving.predictor import Prediction
from ml.store.labels import Label, LabelSource
from ml.store.sessions import Session
from server_gui.core.archive import label_hits
from server_gui.core.archive.label_hits import LabelHits
from server_gui.core.archive.recorded_predictions import PastPrediction
from server_gui.core.settings.server_file import ServerSettings, StoreSettings

SECOND = 10**9
SESSION = Session("exo-01", "s1")
SETTINGS = ServerSettings({}, StoreSettings("file:///nowhere"))
ALL = 0, 100 * SECOND


def predicted(at_s: int, label: str) -> PastPrediction:
    stamp_ns = at_s * SECOND
    return PastPrediction(
        5 * SECOND + stamp_ns, Prediction("activity", "m1", stamp_ns, label, 0.9, 0.0, {}, {})
    )


def labelled(begin_s: int, end_s: int, word: str, source: LabelSource = LabelSource.PERSON) -> Label:
    return Label("exo-01", "s1", (5 + begin_s) * SECOND, (5 + end_s) * SECOND, word, "ada", source)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[int, int]]:
    """The spans that were read; every second somebody walks by the model, and stands at the end."""
    spans: list[tuple[int, int]] = []

    def said(_settings: object, _session: object, begin_ns: int, end_ns: int) -> list[PastPrediction]:
        spans.append((begin_ns, end_ns))
        every = [predicted(at_s, "walk" if at_s < 40 else "stand") for at_s in range(60)]
        return [one for one in every if begin_ns <= one.utc_ns < end_ns]

    class Cards:
        def __init__(self, _url: str) -> None:
            pass

        def card(self, model: str) -> Any:
            if model != "m1":
                raise UnusableModel(model)
            return SimpleNamespace(classes=("walk", "stand"), learned=frozenset({"learned"}))

    monkeypatch.setattr(label_hits, "said", said)
    monkeypatch.setattr(label_hits, "Registry", Cards)
    return spans


def at_once(work: Any) -> "Future[Any]":
    future: Future[Any] = Future()
    future.set_result(work())
    return future


def hits(session: Session, span: tuple[int, int], *labels: Label) -> str:
    made = LabelHits(SETTINGS, at_once, lambda call: call())
    made.look(session, span, labels)
    return made.text


@pytest.mark.usefixtures("asked")
def test_right_and_wrong_are_counted_where_somebody_has_labelled() -> None:
    text = hits(SESSION, ALL, labelled(0, 30, "walk"), labelled(30, 58, "stand"))
    assert text.startswith("Activity predicted then: ")
    assert "right" in text
    right, wrong = (float(part.split()[-3]) for part in text.split(": ")[1].split(", ")[:2])
    assert right == pytest.approx(100 * 48 / 58, abs=4.0)
    assert right + wrong == pytest.approx(100.0, abs=0.2)


@pytest.mark.usefixtures("asked")
def test_only_the_span_counts_and_what_proves_nothing_is_not_counted() -> None:
    labels = labelled(0, 30, "walk"), labelled(30, 58, "stand")
    text = hits(SESSION, (5 * SECOND, 36 * SECOND), *labels)
    assert text.startswith("Activity predicted then: 100.0 % right, "), text
    assert hits(SESSION, ALL) == "", "nobody has labelled it"
    assert hits(SESSION, ALL, labelled(0, 30, "walk", LabelSource.PSEUDO)) == "", "a model has"
    assert hits(Session("exo-01", "learned"), ALL, *labels) == "", "the model has learned from it"


def test_the_same_is_asked_once(asked: list[tuple[int, int]]) -> None:
    made = LabelHits(SETTINGS, at_once, lambda call: call())
    for _ in range(3):
        made.look(SESSION, ALL, (labelled(0, 30, "walk"),))
    assert asked == [ALL]
