"""The set of patients' walks, made into the file that the benchmarks read."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ml.benchmarks import impaired
from tools import impaired_gait
from tools.impaired_gait import COLUMNS, made, main

ROWS = 40


def written(folder: Path, subject: int, trial: int, **about: Any) -> Path:
    """One trial as the set has it."""
    path = folder / f"{subject}-{trial}.json"
    known = {
        "Subject": subject,
        "Trial": trial,
        "PathologyGroup": "Healthy",
        "Sensor": "XSens",
        "LeftFootActivity": [[5, 15], [20, 30]],
        "RightFootActivity": [[10, 22], [20, 30]],
    }
    path.write_text(json.dumps(known | about))
    names = ("LAV", "LAX", *COLUMNS, "RAZ")
    values = np.tile(np.arange(len(names), dtype=float), (ROWS, 1))
    rows = "\n".join(",".join(f"{value:.6e}" for value in row) for row in values)
    path.with_suffix(".csv").write_text(",".join(names) + "\n" + rows + "\n")
    return path


def test_the_file_is_what_the_benchmarks_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for subject, group in ((10, "Neurological"), (9, "Healthy"), (2, "Healthy")):
        written(tmp_path, subject, 1, PathologyGroup=group, Sensor="TCon" if subject == 10 else "XSens")
    out = tmp_path / "made.npz"
    assert main([str(tmp_path), "--out", str(out)]) == 0
    assert capsys.readouterr().out.startswith("3 people")
    walks = impaired.read(out)
    assert [(walk.subject, walk.group, walk.sensor) for walk in walks] == [
        (2, "healthy", "XSens"),
        (9, "healthy", "XSens"),
        (10, "neurological", "TCon"),
    ]
    assert np.allclose(walks[0].rates[0], np.radians([2, 3, 4, 5, 6, 7]), atol=math.radians(0.05))
    assert np.flatnonzero(walks[0].moving[0]).tolist() == [*range(5, 15), *range(20, 30)]


def test_steps_that_the_labels_let_overlap_stay_two(tmp_path: Path) -> None:
    written(tmp_path, 1, 1)
    right = made(tmp_path)["right_moving"]
    assert np.flatnonzero(right).tolist() == [*range(10, 19), *range(20, 30)]


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"PathologyGroup": "Unknown"}, "not as the set's trials"),
        ({"Sensor": "Other"}, "not as the set's trials"),
        ({"LeftFootActivity": None}, "not as the set's trials"),
    ],
)
def test_a_trial_of_another_kind_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], about: dict[str, Any], words: str
) -> None:
    written(tmp_path, 1, 1, **about)
    assert main([str(tmp_path), "--out", str(tmp_path / "made.npz")]) == 1
    said = capsys.readouterr().err
    assert words in said
    assert "1-1.json" in said


@pytest.mark.parametrize(
    ("text", "words"),
    [("LAV,LRX\n1,2\n", "lacks the columns"), (",".join(COLUMNS) + "\n1,2,3,4,5,nan\n", "no numbers")],
)
def test_signals_that_cannot_be_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], text: str, words: str
) -> None:
    written(tmp_path, 1, 1).with_suffix(".csv").write_text(text)
    assert main([str(tmp_path), "--out", str(tmp_path / "made.npz")]) == 1
    assert words in capsys.readouterr().err


def test_a_folder_without_the_set_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path), "--out", str(tmp_path / "made.npz")]) == 1
    assert "GaitData" in capsys.readouterr().err


def test_the_tool_and_the_benchmark_name_the_same_channels() -> None:
    assert impaired_gait.CHANNELS == impaired.CHANNELS
