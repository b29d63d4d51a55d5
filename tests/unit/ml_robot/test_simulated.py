"""Recordings of the simulator: read as they were written, and files that are none refused."""

import gzip
import json
from pathlib import Path

import numpy as np
import pytest

from ml.errors import UnusableData
from ml.robot.task import TASKS, recipe_named
from ml.serving.predictor import replayed
from ml.training.simulated import examples, read, stepping
from tests.unit.ml_robot.recorded import CHANNELS, lines, written
from tests.unit.ml_robot.test_learned import learned


def test_every_session_is_read_plain_compressed_and_joined(tmp_path: Path) -> None:
    plain = written(tmp_path / "a.jsonl", [3, 4], rounds=1)
    packed = tmp_path / "b.jsonl.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()) * 2)
    sessions = read(plain)
    assert [session.subject for session in sessions] == ["3", "4"]
    assert len(read(packed)) == 4
    first, rows = sessions[0], lines(3, 1)[1:]
    assert first.channels == CHANNELS
    assert first.values.tolist() == [row[4:] for row in rows]
    assert first.label.tolist() == [row[1] for row in rows]
    assert np.isnan(first.phase[0]).all()
    walking = int(np.flatnonzero(first.label == "walk")[50])
    assert first.phase[walking].tolist() == rows[walking][2:4]


def test_a_decision_is_about_the_moment_before_its_delay(tmp_path: Path) -> None:
    task, recipe = TASKS["activity"], recipe_named("activity/hips")
    [session] = read(written(tmp_path / "a.jsonl", [3], rounds=1))
    found = examples(task, recipe, [session], 5)
    assert found.time_ns[0] == 20_000_000 * recipe.look_back
    assert set(np.diff(found.time_ns)) == {100_000_000}
    row = np.searchsorted(session.stamps_ns, found.time_ns - 200_000_000)
    assert found.label.tolist() == session.label[row].tolist()


def test_examples_are_what_a_replay_judges(tmp_path: Path) -> None:
    model = learned()
    [session] = read(written(tmp_path / "a.jsonl", [3], rounds=1))
    found = examples(model.task, model.recipe, [session], 5)
    said = replayed("m", model, session.stamps_ns, session.of(model.recipe.channels), 100_000_000)
    by_time = {one.stamp_ns: one for one in said}
    verdicts = model.judge(found.features)
    assert all(
        by_time[int(at)].novelty == novelty
        for at, novelty in zip(found.time_ns, verdicts.novelty, strict=True)
    )


def test_where_nobody_can_say_no_phase_is_learned() -> None:
    label = np.array(["stand", "stand", "walk", "fall", "sit"])
    phase = np.array([[np.nan, np.nan], [0.1, 0.6], [0.2, 0.7], [0.3, 0.8], [np.nan, np.nan]])
    assert stepping(label, phase)[1].tolist() == [True, False, True, False, True]


WRONG = {
    "nothing": (b"", "holds no session"),
    "no json": (b"walk, walk\n", "is not what gwrms sim-record writes"),
    "no head": (b"[1, 2]\n", "is not what gwrms sim-record writes"),
    "other columns": (b'{"session": "a", "subject": 1, "columns": ["x"]}\n[1]\n', "do not begin with time"),
    "a short line": (
        json.dumps(
            {"session": "a", "subject": 1, "columns": ["time", "label", "left_phase", "right_phase", "x"]}
        ).encode()
        + b'\n[10, "walk", 0.1, 0.6]\n',
        "has not the 5 columns",
    ),
    "packed, then damaged": (b"\x1f\x8b\x08\0\0\0\0\0\0\x03" + b"\xff" * 40, "damaged"),
    "a time too large": (
        (
            b'{"session":"a","subject":1,"columns":["time","label","left_phase","right_phase"]}\n'
            b'[99999999999999999999,"walk",0,0]\n'
        ),
        "damaged",
    ),
    "lists too deep": (b"[" * 100_000 + b"\n", "damaged"),
    "cut off": (gzip.compress(b'{"session": "a", "subject": 1, "columns": []}\n' * 99)[:-9], "damaged"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_file_that_is_no_recording_is_refused_in_a_sentence(case: str, tmp_path: Path) -> None:
    content, sentence = WRONG[case]
    file = tmp_path / "sim.jsonl"
    file.write_bytes(content)
    with pytest.raises(UnusableData, match=sentence):
        read(file)


def test_a_channel_that_is_not_there_and_a_session_that_is_too_short_are_named(tmp_path: Path) -> None:
    task, recipe = TASKS["activity"], recipe_named("activity/hips")
    head, *rows = lines(1, 1)
    short = tmp_path / "short.jsonl"
    short.write_text("\n".join(json.dumps(line) for line in [head, *rows[:100]]), encoding="utf-8")
    with pytest.raises(UnusableData, match="no session is as long"):
        examples(task, recipe, read(short), 5)
    lacking = tmp_path / "lacking.jsonl"
    head["columns"] = [*head["columns"][:4], "left_hip.position"]
    lacking.write_text(
        "\n".join(json.dumps(line[:5] if line is not head else line) for line in [head, *rows])
    )
    with pytest.raises(UnusableData, match=r"has no right_hip\.position"):
        examples(task, recipe, read(lacking), 5)
