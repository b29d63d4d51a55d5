"""What models said when a recording was made is played with it, at its instant, and never as live."""

import functools
from pathlib import Path

import msgspec
import pytest

from ml.serving.predictor import Prediction
from ml.serving.trust import Trust
from ml.store import Store
from server_gui.core.archive.playback import NOT_PREDICTED, Playback
from server_gui.core.archive.recorded_predictions import said
from server_gui.core.cloud.tape import Tape
from server_gui.core.desk.desk import Shown
from server_gui.core.fleet.live_prediction import record as record_of
from server_gui.core.prediction import newest_predictions as module
from server_gui.core.prediction.news import Predicted
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from server_gui.core.settings.server_file import RecordingSettings, ServerSettings, StoreSettings
from tests.unit.desk.test_playback import at_once, record, settle, tape_of
from tests.unit.ml.serving.small import learned
from tests.unit.prediction.robots import card


@pytest.fixture
def settings(tmp_path: Path, folder_url: str) -> ServerSettings:
    return ServerSettings({}, StoreSettings(folder_url), RecordingSettings(spool=tmp_path / "spool"))


def predict(settings: ServerSettings, tape: Tape, at_ms: dict[int, str], *, sent: bool) -> None:
    """A model said these labels, so long after the recording's beginning."""
    rows = []
    for after_ms, label in at_ms.items():
        said = Prediction("activity", "activity-1", after_ms, label, 0.9, 0.1, {"walk": 0.9}, {"left": 0.5})
        about = Predicted("exo-01", said, card(learned()), Trust(), tape.first_ns + after_ms * 10**6, None)
        rows.append(record_of(tape.session.session, about))
    with Spool(settings.recorder.spool, reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            recorder.add(*rows)
        for number in spool.waiting() if sent else ():
            send(spool, number, Store(settings.store.url))


@pytest.mark.parametrize("sent", [True, False])
def test_what_a_model_said_then_is_shown_at_its_instant_and_never_as_live(
    settings: ServerSettings, sent: bool
) -> None:
    record(settings, sent=sent)
    tape = tape_of(settings)
    predict(settings, tape, {100: "walk", 500: "stand"}, sent=sent)
    playback = Playback(at_once, lambda call: call(), Shown())
    playback.open(tape, recall=functools.partial(said, settings, tape.session))
    predictions = playback.desk.stations[0].predictions
    for after_ms, label in ((50, None), (200, "walk"), (700, "stand"), (150, "walk")):
        playback.seek(tape.first_ns + after_ms * 10**6)
        settle(playback)
        found = predictions.told.get("activity")
        assert (found and found.prediction.label) == label
    assert predictions.told["activity"].age_s() == pytest.approx(0.050, abs=0.001)
    assert predictions.told["activity"].prediction.values == {"left": 0.5}
    assert not predictions.by_task


def test_what_was_said_long_before_is_not_shown_and_nothing_is_said_of_another_session(
    settings: ServerSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    record(settings)
    tape = tape_of(settings)
    predict(settings, tape, {100: "walk"}, sent=True)
    predict(settings, tape, {100: "walk"}, sent=False)  # the same row again, of an upload that was cut off
    begin_ns, end_ns = tape.first_ns, tape.last_ns
    assert [one.prediction.label for one in said(settings, tape.session, begin_ns, end_ns)] == ["walk"]
    other = msgspec.structs.replace(tape.session, session="another")
    assert said(settings, other, begin_ns, end_ns) == []
    monkeypatch.setattr(module, "STALE_S", 0.2)
    playback = Playback(at_once, lambda call: call(), Shown())
    playback.open(tape, recall=functools.partial(said, settings, tape.session))
    playback.seek(begin_ns + 400 * 10**6)
    settle(playback)
    known = playback.desk.stations[0].predictions
    assert (known.told, known.problem) == ({}, NOT_PREDICTED)
