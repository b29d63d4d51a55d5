"""The whole loop, a simulated robot and an S3 server: record, label, train, promote, better, roll back."""

import contextlib
import io
import itertools
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest

from gateway import main
from ml.robot.groups import GROUPS
from ml.robot.task import TASKS
from ml.store import NoSuchTable, Store
from ml.store.labels import Label, LabelSource
from ml.store.sessions import Session as Stored
from ml.store.sessions import labels, sessions
from ml.training.simulated import SimulatedSession, read
from server_gui.core.archive.labelling import Labelling
from server_gui.core.prediction.state import PredictingState
from server_gui.core.settings.server_file import load
from tests.scenario.collecting import Collecting
from tests.scenario.processes import Bench
from tests.support.waiting import until
from tests.unit.training.walkers import BEGAN_UTC, Made, put

S, MS = 10**9, 10**6
ROBOT = "exo"
CHANNELS = tuple(name for group in GROUPS.values() for name in group)
PRACTICE_S = 40  # that three people sit down and get up, faster than in real time
FIRST = ("stand", "sit")  # what is labelled at first
# live decisions of all tasks: more than ten seconds, in which the wearer sits down, sits, gets up and stands
ENOUGH = 600
PATIENCE_S = 300.0


class Sitter(Bench):
    """Somebody who sits down and gets up, again and again, and of whom we know when."""

    def __init__(self, folder: Path, processes: ExitStack) -> None:
        folder.mkdir()
        self.truth = folder / "truth.jsonl"
        self.simulator_options = ("--scenario", "sit_to_stand", "--truth", str(self.truth))
        super().__init__(folder, processes)


def practice(file: Path) -> list[str]:
    """What makes recordings of three people."""
    command = [sys.executable, "-P", "-m", "gateway.main", "sim-record", "--scenario", "sit_to_stand"]
    return [*command, "--out", str(file), "--subjects", "1-3", "--minutes", str(PRACTICE_S / 60)]


def stretches(session: SimulatedSession) -> Iterator[tuple[float, float, str]]:
    """When who did what, in seconds since the first row."""
    edges = np.flatnonzero(session.label[1:] != session.label[:-1]) + 1
    bounds = [0, *edges.tolist(), len(session.label)]
    for begin, end in itertools.pairwise(bounds):
        yield begin / 100, end / 100, str(session.label[begin])


def put_practice(file: Path, url: str) -> list[Label]:
    """Into the store, of which only `FIRST` is labelled; what else there would be to label."""
    made, later = [], []
    for number, session in enumerate(read(file)):
        began = BEGAN_UTC + number * 3600 * S
        every = list(stretches(session))
        said = [(*one, LabelSource.SIMULATOR) for one in every if one[2] in FIRST]
        name, who = f"practice-{session.subject}", session.subject
        made.append(Made(name, session.of(CHANNELS), said, CHANNELS, wearer=who, robot="practice"))
        later += [
            Label("practice", name, began + round(begin * S), began + round(end * S), what, "ada")
            for begin, end, what in every
            if what not in FIRST
        ]
    put(url, file.with_name("practice-spool"), made)
    return later


def asked(*arguments: str) -> Any:
    """What a command says, as JSON."""
    with contextlib.redirect_stdout(io.StringIO()) as said:
        status = main.main([*arguments, "--json"])
    answer = said.getvalue().splitlines()
    assert status == 0, answer[-1:]
    return json.loads(answer[-1])


def predicted(url: str, model: str) -> list[dict[str, Any]]:
    """What a model has said live."""
    table = Store.existing(url).dataset("predictions").to_table(filter=pc.field("model") == model)
    rows: list[dict[str, Any]] = table.to_pylist()
    return rows


def right(rows: Sequence[dict[str, Any]], truth: Path) -> float:
    """The share of decisions that say what was so, by the simulator."""
    with truth.open() as lines:
        columns = json.loads(next(lines))["columns"]
        every = [json.loads(line) for line in lines if line.endswith("\n")]
    stamp, label = columns.index("monotonic_ns"), columns.index("label")
    stamps = np.array([row[stamp] for row in every], np.int64)
    task = TASKS["activity"]
    about = np.array([row["stamp_ns"] for row in rows], np.int64) - task.delay_ms * MS
    so = [every[at][label] for at in np.searchsorted(stamps, about, side="right") - 1]
    return float(np.mean([task.fold.get(one) == row["label"] for one, row in zip(so, rows, strict=True)]))


def session_of(url: str) -> Stored | None:
    """The robot's session, once he has sat down and got up twice in what is stored of it."""
    try:
        found = sessions(Store.existing(url), ROBOT)
    except NoSuchTable:
        return None
    return next((each for each in found if each.length.total_seconds() > 22), None)


def stored_labels(url: str, session: Stored) -> set[str]:
    return {row["label"] for row in labels(Store.existing(url), session)}


@pytest.mark.timeout(900)
@pytest.mark.parametrize("backend", ["s3"], indirect=True)
def test_what_is_labelled_is_learned_and_serves_and_can_be_taken_back(store_url: str, tmp_path: Path) -> None:
    with ExitStack() as processes:
        file = tmp_path / "practice.jsonl"
        coming = processes.enter_context(subprocess.Popen(practice(file)))
        robot = Sitter(tmp_path / "robot", processes)
        collecting = Collecting(tmp_path, {ROBOT: robot.address})
        config = str(collecting.config)
        collecting.config.write_text(
            f'[robots]\n{ROBOT} = "{robot.address}"\n[store]\nurl = "{store_url}"\n'
            f'[recorder]\nspool = "{collecting.spool}"\nbatch_s = 2\n[prediction]\npoll_s = 1\n'
        )
        processes.callback(collecting.close)
        collecting.start()

        def predicting() -> PredictingState:
            state = collecting.report().prediction
            assert state is not None
            return state

        def until_it_serves(model: str) -> None:
            def serves() -> bool:
                now = predicting().robots.get(ROBOT, {}).get("activity")
                return now is not None and now.model == model

            until(serves, collecting.log, within_s=PATIENCE_S)

        def until_it_has_said_enough() -> None:
            before = predicting().judged
            until(lambda: predicting().judged > before + ENOUGH, collecting.log, within_s=PATIENCE_S)

        assert coming.wait() == 0
        later = put_practice(file, store_url)
        first = asked("train", "activity", "--config", config, "--held-out", "3")["model"]
        asked("models", "promote", first, "--config", config)
        until_it_serves(first)

        # What was not labelled is now: of the practice, and of the robot while it is recorded.
        labelling = Labelling(load(collecting.config))
        for _, of_session in itertools.groupby(later, key=lambda label: label.session):
            labelling.add_all(list(of_session))
        until_it_has_said_enough()
        until(lambda: session_of(store_url) is not None, collecting.log, within_s=PATIENCE_S)
        live = session_of(store_url)
        assert live is not None
        assert asked("label", live.session, "--truth", str(robot.truth), "--config", config)["new"] > 2
        until(lambda: "sit" in stored_labels(store_url, live), collecting.log, within_s=PATIENCE_S)

        trained = asked("train", "activity", "--config", config, "--held-out", "3", "--promote")
        second = trained["model"]
        assert trained["compared_with"] == first
        assert trained["promoted"], trained["why"]
        until_it_serves(second)  # without a restart
        until_it_has_said_enough()

        asked("models", "rollback", "activity", "--config", config)
        until_it_serves(first)
        assert collecting.end() == 0
        asked("cloud", "upload", "--config", config)  # what a busy computer has not yet

    before, after = (right(predicted(store_url, model), robot.truth) for model in (first, second))
    assert after > 0.7  # 0.92 to 0.95
    assert after > before + 0.2
    card = asked("models", "show", second, "--config", config)
    assert card["learned"] == [live.session, "practice-1", "practice-2"]
    assert card["held_out"] == ["practice-3"]
