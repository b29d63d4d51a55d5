"""`gwrms predict --robot`: what is said of robots that nobody records, with faults beside."""

import json
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from msgspec.structs import replace

from gateway.client import Address
from server_gui.cli import predict
from server_gui.core.prediction.live import Live
from server_gui.core.settings.prediction import Action, RuleSettings
from server_gui.core.settings.server_file import SettingsError
from server_gui.terminal.predictions import told
from tests.unit.prediction.robots import SteadyRobot, publish, settings

WAIT_S = 50.0
WALKING = RuleSettings("activity", "walk", 0.5, action=Action.STOP)


@pytest.fixture
def robot() -> Iterator[SteadyRobot]:
    with SteadyRobot() as robot:
        yield robot


def until(live: Live, so: Callable[[], object]) -> None:
    deadline_s = time.monotonic() + WAIT_S
    while not so():
        live.look(0.1)
        assert time.monotonic() < deadline_s, [told(name, watched) for name, watched in live.robots.items()]


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
    argv = ["--config", str(config), "--robot", "exo-01", "--seconds", "0.3"]
    assert predict.main(argv) == 1
    assert predict.main([*argv, "--json"]) == 1
    assert not [line for line in capsys.readouterr().out.splitlines() if "label" in json.loads(line)]
    with pytest.raises(SettingsError, match=r"'h:x' is no robot of the server's file \(exo-01\), and"):
        predict.main(["--config", str(config), "--robot", "h:x"])


def test_prediction_that_is_off_for_recording_is_on_for_who_asks(folder_url: str) -> None:
    off = settings(folder_url)
    off = replace(off, prediction=replace(off.prediction, enabled=False))
    with Live(off, {}) as live:
        assert not live.look(0.0)
