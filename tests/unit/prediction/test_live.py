"""`gwrms predict --robot`: what is said of robots that nobody records, with faults beside."""

import json
import signal
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace

import pytest
from msgspec.structs import replace

from gateway.client import Address, ConnectionState
from server_gui.cli import predict
from server_gui.core.follow.events import LinkChanged
from server_gui.core.follow.robot import Robot
from server_gui.core.prediction.live import Live
from server_gui.core.prediction.news import Predicted, PredictionNews
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.settings.server_file import SettingsError
from server_gui.terminal.predictions import told
from tests.support import waiting
from tests.unit.prediction.robots import SteadyRobot, publish, settings

WALKING = RuleSettings("activity", "walk", 0.5, action=Action.STOP)


@pytest.fixture
def robot() -> Iterator[SteadyRobot]:
    with SteadyRobot() as robot:
        yield robot


def _ended_by_a_prediction(_: Live, foreseen: Sequence[PredictionNews]) -> None:
    if any(isinstance(one, Predicted) and one.robot == "new" for one in foreseen):
        signal.raise_signal(signal.SIGINT)


def until(live: Live, so: Callable[[], object]) -> None:
    def found() -> object:
        return [told(name, watched) for name, watched in live.robots.items()]

    waiting.until(so, found, step=lambda: live.look(0.1))


def test_a_robot_is_predicted_while_somebody_looks_and_no_rule_stops_it(
    robot: SteadyRobot, folder_url: str
) -> None:
    model = publish(folder_url)
    robot.lost.add("left_knee")
    with Live(settings(folder_url, WALKING), {"exo-01": Address.parse(robot.address)}) as live:
        watched = live.robots["exo-01"]
        until(live, lambda: watched.predictions.rules and watched.robot.not_ok())
        text = told("exo-01", watched)
    assert "activity" in text
    assert model in text
    assert "RULE rule activity walk ≥ 0.5 for 0 ms (stop) holds" in text
    assert "FAULT left_knee lost: no heartbeat; check its cable" in text
    assert "no model serves gait_phase" in text
    assert not robot.called("robot.stop")


def test_a_robot_that_is_not_there_is_said_and_no_success(
    robot: SteadyRobot, folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config = tmp_path / "server.toml"
    config.write_text(f'[store]\nurl = "{folder_url}"\n[robots]\nexo-01 = "{robot.address}"\n')
    robot.refuse()
    argv = ["--config", str(config), "--robot", "exo-01", "--seconds", "1.5"]  # to be refused, however busy
    assert predict.main(argv) == 1
    assert predict.main([*argv, "--json"]) == 1
    said = capsys.readouterr()
    assert not [line for line in said.out.splitlines() if "label" in json.loads(line)]
    assert said.err.count("exo-01: waiting: no gateway at") == 2
    assert said.err.count("nothing was predicted") == 2


def test_a_robot_that_stays_away_is_said_once_however_often_it_is_tried(
    capsys: pytest.CaptureFixture[str],
) -> None:
    watched = SimpleNamespace(robot=Robot())
    said = predict._Linked()
    states = (ConnectionState.CONNECTING, ConnectionState.WAITING) * 3
    for state in (*states, ConnectionState.CONNECTED, *states):
        watched.robot.apply(LinkChanged(state, "no gateway" if state is ConnectionState.WAITING else None, 1))
        said(SimpleNamespace(robots={"exo-01": watched}))  # type: ignore[arg-type]
    told = [line.partition("exo-01: ")[2].partition(":")[0] for line in capsys.readouterr().err.splitlines()]
    assert told == ["connecting", "waiting", "connected", "waiting"]


@pytest.mark.parametrize(
    ("asked", "why"),
    [
        ("exo-2", "'exo-2' is no robot of the server's file, which names exo-01; .* exo-2=HOST:PORT"),
        ("", "--robot is empty: say HOST:PORT, or a robot of the server's file, which names exo-01"),
        ("left=", r"left: an address is missing; write HOST:PORT"),
        ("h:x", r"h-x: 'h:x' is not a robot's address; write HOST:PORT"),
        ("left=h:x", r"left: 'h:x' is not a robot's address"),
        ("new=127.0.0.1:1", r"127\.0\.0\.1:1 is exo-01 already"),
    ],
)
def test_a_robot_that_cannot_be_meant_is_refused(tmp_path: Path, asked: str, why: str) -> None:
    config = tmp_path / "server.toml"
    config.write_text('[robots]\nexo-01 = "127.0.0.1:1"\n')
    with pytest.raises(SettingsError, match=why):
        predict.main(["--config", str(config), "--robot", asked])


def test_a_robot_may_be_named_with_its_address(
    robot: SteadyRobot, folder_url: str, capsys: pytest.CaptureFixture[str]
) -> None:
    publish(folder_url)
    argv = ["--robot", f"new={robot.address}", "--url", folder_url, "--seconds", "60", "--json"]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(predict, "_show_json", _ended_by_a_prediction)
        assert predict.main(argv) == 0
    assert "gwrms predict: new: connected" in capsys.readouterr().err


def test_prediction_that_is_off_for_recording_is_on_for_who_asks(folder_url: str) -> None:
    off = settings(folder_url)
    off = replace(off, prediction=replace(off.prediction, enabled=False))
    with Live(off, {}) as live:
        assert not live.look(0.0)
