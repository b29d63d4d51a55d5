"""A training in a process: how far it is, what came of it, why it cannot be, and that it can be cancelled."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from ml.registry.registry import Registry
from server_gui.core.cloud.jobs import Job, Jobs, JobState
from server_gui.core.models.training import Trained, TrainingFailed, TrainingWish, heard
from server_gui.processes.training import training
from tests.support.waiting import until
from tests.unit.training.walkers import day, put


@pytest.fixture
def jobs() -> Iterator[Jobs]:
    made = Jobs()
    yield made
    assert made.close(30.0)


def test_lines_say_how_far_it_is_and_the_last_what_came_of_it() -> None:
    job = Job("Train")
    assert heard("a library warns of something", job) is None
    assert heard('{"progress": {"what": "reading sessions", "done": 3, "total": 12}}', job) is None
    assert (job.done, job.total, job.unit) == (3, 12, "sessions read")
    answer = {
        "model": "activity-1",
        "better": False,
        "verdict": "not better",
        "why": ["as good"],
        "over": "activity-0",
        "held_out": {},
    }
    trained = heard(json.dumps(answer), job)
    assert trained == Trained("activity-1", "not better", ("as good",), "activity-0")
    assert trained.said == "Not better: as good"
    assert not trained.may_serve
    wrong = {"kind": "UnusableData", "message": "it takes two to learn from and one to judge by"}
    with pytest.raises(TrainingFailed, match="it takes two to learn from and one to judge by"):
        heard(json.dumps({"error": wrong}), job)


def test_what_is_wished_is_the_command() -> None:
    wish = TrainingWish("gait_phase", "exo-01", ("P03", "P07"))
    assert wish.arguments("file:///store") == [
        *("train", "gait_phase", "--json", "--progress", "--url", "file:///store"),
        *("--robot", "exo-01", "--held-out", "P03", "--held-out", "P07"),
    ]
    assert wish.title == "Train gait phase for exo-01"


def test_a_model_is_trained_in_a_process_and_serves_nobody(
    folder_url: str, tmp_path: Path, jobs: Jobs
) -> None:
    put(folder_url, tmp_path / "spool", [day(f"s{number}", number, each_s=5.0) for number in range(4)])
    found: list[Trained] = []
    job = jobs.add("Train", training(folder_url, TrainingWish("activity", "", ("s3",)), found.append))
    until(lambda: job.is_over)
    assert (job.state, ". Not compared with " in job.said) == (JobState.DONE, True)
    registry = Registry(folder_url)
    assert registry.card(found[0].model).held_out == ("s3",)
    assert registry.history("activity") == []


def test_too_few_wearers_are_named_and_nothing_is_published(
    folder_url: str, tmp_path: Path, jobs: Jobs
) -> None:
    put(folder_url, tmp_path / "spool", [day(f"s{number}", number, each_s=5.0) for number in range(2)])
    job = jobs.add("Train", training(folder_url, TrainingWish("activity"), lambda _: None))
    until(lambda: job.is_over)
    assert job.state is JobState.FAILED
    assert (
        "wearers or sessions with labels: s0, s1; it takes two to learn from and one to judge by" in job.said
    )
    registry = Registry(folder_url)
    assert {each.id for each in registry.entries()} == registry.shipped()


def test_a_training_that_is_cancelled_ends_its_process_and_publishes_nothing(
    folder_url: str, tmp_path: Path, jobs: Jobs
) -> None:
    put(folder_url, tmp_path / "spool", [day(f"s{number}", number, each_s=5.0) for number in range(4)])
    job = jobs.add("Train", training(folder_url, TrainingWish("activity"), lambda _: None))
    until(lambda: job.state is JobState.RUNNING)
    job.cancel()
    until(lambda: job.is_over)
    assert job.state is JobState.CANCELLED
    registry = Registry(folder_url)
    assert {each.id for each in registry.entries()} == registry.shipped()


def test_a_store_that_is_gone_is_named(tmp_path: Path, jobs: Jobs) -> None:
    url = (tmp_path / "nowhere").as_uri()
    job = jobs.add("Train", training(url, TrainingWish("activity"), lambda _: None))
    until(lambda: job.is_over)
    assert (job.state, "there is no store at" in job.said) == (JobState.FAILED, True)
