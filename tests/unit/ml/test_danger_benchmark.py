"""`sim-danger`: what counts as foreseen and as a false alarm, by hand; and recordings that are none."""

import json
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_limits

from ml.benchmarks import danger
from ml.benchmarks.danger import LEAD_S, PERIOD_S, Judged, cross_judged, events, false_alarms, outcome
from ml.benchmarks.danger_data import HEALTHY, LEARNED_S, OVER, Seen, read
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.reliability import drawn
from ml.danger.detector import DETECTORS
from ml.danger.levels import Level
from ml.danger.observation import CHANNELS
from ml.errors import UnusableData

CALM, COMES, LIES = 1000, 50, 25  # rows


def seen(subject: str, name: str = "overheating", *, is_seen: bool = True, silent: bool = False) -> Seen:
    """A wearer who walks, meets a danger that does harm, and walks again; `silent`: no detector speaks."""
    source = np.random.default_rng(int(subject))
    parts = [(HEALTHY, CALM), (1.0, COMES), (1.5, LIES), (OVER, LIES), (HEALTHY, CALM // 5)]
    danger = np.concatenate([np.full(count, number) for number, count in parts])
    above = np.abs(source.normal(0.0, 1.0, (len(danger), len(DETECTORS))))
    if is_seen:
        above[danger == 1.0] += 30.0
    at_s = PERIOD_S * np.arange(len(danger), dtype=np.float64) + LEARNED_S
    labels = np.full(len(danger), "walk")
    return Seen(subject, (name,), at_s, np.full_like(above, np.nan) if silent else above, danger, labels)


def judged(danger: list[float], level: list[Level]) -> Judged:
    """One wearer, a row a tenth of a second."""
    count = len(danger)
    at_s = LEARNED_S + 1.0 + 0.1 * np.arange(count, dtype=np.float64)
    one = Seen(
        "1", ("slip",), at_s, np.zeros((count, len(DETECTORS))), np.array(danger), np.full(count, "walk")
    )
    return Judged(one, np.zeros(count), np.array(level, dtype=np.int_))


def test_what_is_said_too_late_before_harm_is_not_foreseen() -> None:
    danger = [0.0] * 5 + [1.0] * 5 + [1.5] * 5
    for reached, foreseen in ((5, True), (6, True), (8, False)):
        level = [Level.NONE] * reached + [Level.ADVICE] * (15 - reached)
        (event,) = events(judged(danger, level), Level.ADVICE)
        assert event.lead_s == pytest.approx(0.1 * (10 - reached))
        assert event.foreseen is foreseen
    (event,) = events(judged(danger, [Level.EARLY] * 15), Level.ADVICE)
    assert event.lead_s is None
    assert not event.foreseen
    assert LEAD_S == 0.3


def test_a_danger_that_did_no_harm_or_whose_recording_ends_counts_as_none() -> None:
    said = [Level.ADVICE] * 10
    assert not list(events(judged([0.0] * 5 + [1.0] * 5, said), Level.ADVICE))
    assert not list(events(judged([0.0] * 2 + [1.0] * 4 + [OVER] * 4, said), Level.ADVICE))


def test_alarms_of_one_moment_are_one_and_unknown_is_none() -> None:
    level = [Level.NONE, Level.ADVICE, Level.NONE, Level.ALARM] + [Level.NONE] * 196
    level += [Level.ADVICE] * 2 + [Level.UNKNOWN] * 8
    walking = np.ones(len(level), dtype=np.bool_)
    assert false_alarms(judged([0.0] * len(level), level), Level.ADVICE, walking) == 2
    assert false_alarms(judged([0.0] * len(level), [Level.UNKNOWN] * len(level)), Level.EARLY, walking) == 0


def test_what_is_shown_is_foreseen_on_people_never_seen_and_what_is_not_is_missed() -> None:
    names = ("overheating", "friction", "overheating", "friction")
    people = [seen(str(number), name, is_seen=name == "overheating") for number, name in enumerate(names, 1)]
    with threadpool_limits(limits=1):
        found = outcome(cross_judged(people))
    assert (found.subjects, found.figures["events"]) == (4, 4.0)
    assert found.by_group["overheating"]["foreseen"] == 1.0
    assert found.by_group["friction"]["foreseen"] == 0.0
    assert found.figures["foreseen"] == 0.5
    assert found.figures["foreseen_low"] < 0.5 < found.figures["foreseen_high"]
    assert found.figures["advice_high"] > 1.0  # in some minutes nobody can show fewer


def test_detectors_that_never_speak_foresee_nothing_and_break_nothing() -> None:
    found = outcome(cross_judged([seen(str(number), silent=True) for number in (1, 2)]))
    assert found.figures["foreseen"] == 0.0
    assert math.isfinite(found.figures["brier"])


def test_the_diagram_has_a_point_for_each_tenth() -> None:
    picture = drawn([(0.1, 0.0, 900), (0.9, 1.0, 9)])
    assert picture.count("<circle") == 2
    assert picture.startswith("<svg")


def recording(path: Path, *subjects: int, columns: tuple[str, ...] = CHANNELS, cut: int = 0) -> Path:
    """As `gwrms sim-record --scenario dangers` writes it, without a value in it."""
    lines = []
    for subject in subjects:
        names = ["stamp_ns", "label", "danger", *columns]
        head = {"session": f"s{subject}", "subject": subject, "columns": names, "dangers": ["slip"]}
        lines += [json.dumps(head)]
        lines += [json.dumps([at * 10_000_000, "walk", 0.0, *[None] * len(columns)]) for at in range(8)]
    text = "\n".join(lines) + "\n"
    path.write_text(text[: len(text) - cut])
    return path


def test_a_recording_without_a_value_is_silent_and_one_that_still_grows_is_read(tmp_path: Path) -> None:
    for cut in (0, 20):
        one, other = read(recording(tmp_path / "dangers.jsonl", 1, 2, cut=cut))
        assert (one.subject, other.subject) == ("1", "2")
        assert np.isnan(one.above).all()


@pytest.mark.parametrize("length", range(0, 1200, 111))
def test_a_recording_cut_anywhere_is_read_or_refused(length: int, tmp_path: Path) -> None:
    file = recording(tmp_path / "dangers.jsonl", 1, 2)
    whole = file.read_bytes()
    file.write_bytes(whole[:length])
    with pytest.raises(UnusableData):
        read(file)


def begun(path: Path, *subjects: int) -> None:
    """Append wearers of whom nothing was recorded yet."""
    with path.open("a") as file:
        for subject in subjects:
            head = {"session": "s", "subject": subject, "columns": ["stamp_ns", "label", "danger", *CHANNELS]}
            file.write(json.dumps(head | {"dangers": ["slip"]}) + "\n")


EVALUATIONS = pytest.mark.parametrize("evaluate", [danger.evaluate, danger.evaluate_shipped])


@EVALUATIONS
def test_recordings_that_end_before_anybody_is_known_are_refused(
    evaluate: Callable[[Path, bool], Outcome], tmp_path: Path
) -> None:
    file = recording(tmp_path / "dangers.jsonl", 1)
    begun(file, 2)
    assert [len(one.at_s) for one in read(file)] == [2, 0]
    with pytest.raises(UnusableData, match=r"dangers\.jsonl holds fewer than two wearers .* beyond"):
        evaluate(file, False)


@EVALUATIONS
def test_a_wearer_without_a_row_is_left_out_with_a_word(
    evaluate: Callable[[Path, bool], Outcome], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "dangers.jsonl"
    begun(file, 7, 9)
    people = [seen("1"), seen("2"), *read(file)]
    monkeypatch.setattr(danger, "read", lambda _path: people)
    found = evaluate(file, False)
    assert (found.subjects, found.figures["events"]) == (2, 2.0)
    assert found.notes[-1].endswith("wearers 7, 9")


@EVALUATIONS
def test_where_nobody_walks_on_level_ground_nothing_is_said_of_false_alarms(
    evaluate: Callable[[Path, bool], Outcome], monkeypatch: pytest.MonkeyPatch
) -> None:
    people = [replace(one, label=np.full(len(one.label), "stairs_up")) for one in (seen("1"), seen("2"))]
    monkeypatch.setattr(danger, "read", lambda _path: people)
    if evaluate is danger.evaluate:
        with pytest.raises(UnusableData, match="level ground"):
            evaluate(Path("stairs.jsonl"), False)
        return
    found = evaluate(Path("stairs.jsonl"), False)
    assert found.figures["foreseen"] == 1.0
    assert (found.figures["healthy_hours"], found.figures["stops"]) == (0.0, 0.0)
    assert math.isnan(found.figures["stops_per_100_h_upper"])
    assert math.isnan(found.figures["advice_high"])


def test_weights_are_not_learned_where_nobody_is_in_danger(monkeypatch: pytest.MonkeyPatch) -> None:
    calm = [replace(one, danger=np.zeros_like(one.danger)) for one in (seen("1"), seen("2"))]
    monkeypatch.setattr(danger, "read", lambda _path: calm)
    with pytest.raises(UnusableData, match="meets a danger"):
        danger.evaluate(Path("healthy.jsonl"), search=False)


def test_what_is_no_such_recording_is_refused_with_its_name(tmp_path: Path) -> None:
    file = tmp_path / "other.jsonl"
    for text in ("", "nonsense\n", '{"session": 1}\n', '[1, 2]\n{"a": 1}\n'):
        file.write_text(text)
        with pytest.raises(UnusableData, match=r"other\.jsonl"):
            read(file)
    with pytest.raises(UnusableData, match="fewer than two wearers"):
        read(recording(file, 1))
    with pytest.raises(UnusableData, match="dangers writes"):
        read(recording(file, 1, 2, columns=CHANNELS[1:]))


def test_where_nobody_is_in_danger_false_alarms_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    calm = [replace(one, danger=np.zeros_like(one.danger)) for one in (seen("1"), seen("2", is_seen=False))]
    monkeypatch.setattr(danger, "read", lambda _path: calm)
    found = danger.evaluate_shipped(Path("healthy.jsonl"), search=False)
    assert found.figures["events"] == 0.0
    assert found.figures["advice_per_hour"] * found.figures["healthy_hours"] == pytest.approx(1.0)
    assert found.figures["stops_per_100_h_extrapolated"] > 0.0


def test_the_calibration_that_ships_learns_nothing_of_whom_it_judges(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(danger, "read", lambda _path: [seen("1"), seen("2", is_seen=False)])
    monkeypatch.setattr(danger, "learn", lambda *_: pytest.fail("it learned"))
    found = danger.evaluate_shipped(Path("dangers.jsonl"), search=False)
    assert (found.figures["events"], found.figures["foreseen"]) == (2.0, 0.5)
