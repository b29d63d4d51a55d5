"""Gait events of feet: which moments may be events, which are, and how they are counted."""

import json
from pathlib import Path

import numpy as np
import pytest

from ml.benchmarks import events, ipol, losses, metrics
from ml.benchmarks.models.gait_events import EventModel, EventSettings
from ml.errors import UnusableData
from ml.features.gait_status import CHANNELS
from server_gui.cli.evaluate import main
from tests.unit.ml import recordings
from tests.unit.ml.recordings import saved


def test_each_true_event_is_matched_once_and_as_many_as_can_be() -> None:
    true, found = np.array([10, 14, 40]), np.array([12, 18, 60])
    assert metrics.matches(true, found, 5) == 2
    assert metrics.matches(np.array([10]), np.array([8, 9, 11]), 5) == 1
    assert metrics.matches(np.array([10]), np.array([16]), 5) == 0
    assert metrics.matches(np.array([10]), np.array([15]), 5) == 1
    assert metrics.matches(true, found[:0], 5) == 0


def test_each_moment_knows_how_far_the_nearest_event_of_each_kind_is() -> None:
    none = np.array([], dtype=np.int_)
    foot = events.Foot(
        1, np.zeros((3, 1), dtype=np.float32), np.array([0, 24, 90]), (np.array([26, 60]), none), (2, 0)
    )
    assert foot.apart()[:, 0].tolist() == [26, 2, 30]
    assert (foot.apart()[:, 1] > 1000).all()


def test_an_event_is_the_top_of_a_bump_and_no_other_is_as_near_as_a_step() -> None:
    at = np.arange(0, 400, 2)
    tops, high = np.array([[101], [125], [251]]), np.array([[1.0], [0.6], [0.5]])
    height = (np.exp(-0.5 * ((at - tops) / 3.0) ** 2) * high).sum(axis=0)
    model = EventModel(EventSettings(threshold=0.4))
    assert model.events(at, height).tolist() == [101, 251]
    assert model.events(at[:0], height[:0]).tolist() == []
    assert EventModel(EventSettings(threshold=0.55)).events(at, height).tolist() == [101]


def test_a_top_is_known_60_ms_after_it() -> None:
    at = np.arange(0, 100, 2)
    height = np.exp(-0.5 * ((at - 51) / 3.0) ** 2)
    model = EventModel()
    for known in (58, 70, 98):
        assert model.events(at[at <= known], height[at <= known]).tolist() == [51]


def test_a_foot_at_rest_is_not_asked_about(tmp_path: Path) -> None:
    trials = ipol.read(saved(tmp_path / "gait.npz", recordings.gait(subjects=2, trials=1)))
    left = events.feet_of(trials)[0]
    assert left.at.min() > 150  # two seconds of standing
    assert left.seen == tuple(len(true) for true in left.true)


def test_events_of_clockwork_people_are_found_also_where_packets_are_lost(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(events, "SETTINGS", EventSettings(hidden=(24, 12), networks=1, epochs=25))
    arrays = recordings.gait(subjects=2, trials=2, seconds=8.0)
    for side in ("left_event", "right_event"):  # it leaves the ground while it pushes off, not before
        arrays[side] &= np.roll(arrays[side], 5)
    file = saved(tmp_path / "gait.npz", arrays)
    assert main(["--benchmark", "ipol-events", "--data", str(file), "--json"]) == 0
    found = json.loads(capsys.readouterr().out.rstrip("\n").split("\n")[-1])
    assert found["subjects"] == 2
    assert found["heel_strike_f1"] > 0.9
    assert found["toe_off_f1"] > 0.9
    assert found[losses.at("heel_strike_f1", 0.2)] > 0.7
    assert found["worst_subject_toe_off_f1"] <= found["toe_off_f1"] + 0.05


def test_people_who_never_step_are_refused_in_words(tmp_path: Path) -> None:
    arrays = recordings.gait(subjects=2, trials=1)
    for side in ("left", "right"):
        arrays[f"{side}_event"][:] = 0
    with pytest.raises(UnusableData, match="too few feet step"):
        events.evaluate(saved(tmp_path / "gait.npz", arrays), False)


def test_what_was_held_is_missing_but_for_a_trials_first_row_and_long_silences(tmp_path: Path) -> None:
    arrays = recordings.gait(subjects=2, trials=1)
    held = np.zeros((len(arrays["x"]), 3), dtype=bool)
    held[0:3, 0] = True
    held[100:103, 2] = True
    held[200 : 201 + ipol.LONGEST, 1] = True
    arrays["held"] = held
    samples = ipol.read(saved(tmp_path / "gait.npz", arrays))[0].samples
    assert np.flatnonzero(np.isnan(samples[:, 0])).tolist() == [1, 2]
    assert np.flatnonzero(np.isnan(samples[:, 12])).tolist() == [100, 101, 102]
    assert np.isnan(samples[:, 6]).sum() == ipol.LONGEST
    assert not np.isnan(samples[200 + ipol.LONGEST, 6])


def test_a_held_of_another_shape_is_refused(tmp_path: Path) -> None:
    arrays = {**recordings.gait(subjects=2, trials=1), "held": np.zeros((5, 3), dtype=bool)}
    with pytest.raises(UnusableData, match="'held' has the shape"):
        ipol.read(saved(tmp_path / "gait.npz", arrays))


def test_lost_packets_are_a_sensors_whole_rows_and_as_many_as_asked_for(tmp_path: Path) -> None:
    trials = ipol.read(saved(tmp_path / "gait.npz", recordings.gait(subjects=2, trials=1)))
    lossy = ipol.lossy(trials, 0.2)[0].samples
    gone = np.isnan(lossy).reshape(len(lossy), 3, len(CHANNELS) // 3)
    assert (gone.all(axis=2) == gone.any(axis=2)).all()
    assert not gone[0].any()
    assert abs(gone.mean() - 0.2) < 0.03
    assert np.array_equal(lossy, ipol.lossy(trials, 0.2)[0].samples, equal_nan=True)
