"""The whole chain as its users run it: simulator, gateway and client, each a process of its own."""

import json
from pathlib import Path

from gateway.client import Address, LinkSettings, Robot
from tests.scenario.processes import Bench, gwrms
from tests.support.waiting import until

FORCES = ("left_insole.force", "right_insole.force")
STRIDE = 100  # rows at 50 Hz: more than one stride of the slowest gait that is set here


def hip_range(bench: Bench) -> float:
    """How far the left hip moves, in rad, as `gwrms watch` in a process of its own sees it."""
    arguments = ("watch", "left_hip.position", "--rate", "50", "--count", str(STRIDE), "--json")
    watched = gwrms(*arguments, "--robot", bench.address)
    assert watched.returncode == 0, watched.stderr
    rows = [json.loads(line)["values"]["left_hip.position"] for line in watched.stdout.splitlines()]
    angles = [angle for angle in rows if angle is not None]
    assert len(rows) == STRIDE
    assert len(angles) > STRIDE / 2
    return float(max(angles) - min(angles))


def set_step_length(bench: Bench, *metres: float) -> None:
    """In steps that one write may go."""
    for length in metres:
        written = gwrms("set", f"gait.step_length={length}", "--robot", bench.address, "--json")
        assert written.returncode == 0, written.stderr
        assert json.loads(written.stdout)["after"] == {"gait.step_length": length}


def test_simulator_and_client_outlive_a_killed_gateway(bench: Bench) -> None:
    with Robot(Address(port=bench.port), LinkSettings(silence_s=30.0)) as robot:
        stream = robot.watch("left_hip.position", rate_hz=50)
        before = next(stream)
        bench.kill(bench.gateway)
        bench.simulator.check()
        bench.start_gateway()
        after = next(batch for batch in stream if batch.link > before.link and any(_numbers(batch.columns)))
        assert after.columns.keys() == before.columns.keys()
        stream.close()
    bench.simulator.check()
    bench.until_whole()


def test_gateway_outlives_a_killed_simulator_and_says_what_is_gone(bench: Bench) -> None:
    bench.kill(bench.simulator)
    until(lambda: set(bench.states().values()) == {"lost"})
    gone = bench.ask("component.snapshot")
    assert set(gone["values"].values()) == {None}
    assert all(found["problem"] for found in gone["quality"].values())
    bench.gateway.check()
    bench.start_simulator()
    bench.until_whole()
    bench.gateway.check()


def test_stop_is_confirmed_by_every_drive_and_the_robot_stands(bench: Bench) -> None:
    until(lambda: _stopped(bench))  # where a busy computer let an answer come too late, STOP again
    until(lambda: hip_range(bench) < 0.02)


def _stopped(bench: Bench) -> bool:
    stopped = gwrms("stop", "--robot", bench.address, "--json")
    drives = json.loads(stopped.stdout)["drives"]
    assert len(drives) == 6
    is_confirmed = set(drives.values()) == {"confirmed"}
    assert is_confirmed or "NOT CONFIRMED" in stopped.stderr
    return is_confirmed and stopped.returncode == 0


def test_demo_shows_a_walk_and_ends_everything(tmp_path: Path) -> None:
    shown = gwrms("demo", "--headless", "--seconds", "6", "--dir", str(tmp_path))
    assert shown.returncode == 0, shown.stderr
    assert shown.stdout.rstrip().endswith("The joints moved, the feet alternated, no component was lost.")


def test_demo_of_a_standing_robot_is_no_walk(tmp_path: Path) -> None:
    shown = gwrms("demo", "--headless", "--seconds", "1", "--scenario", "stand", "--dir", str(tmp_path))
    assert shown.returncode == 1
    assert "this was no walk: did not move" in shown.stderr


def _numbers(columns: dict[str, list[float | None]]) -> list[bool]:
    return [value is not None for column in columns.values() for value in column]


# Last: their robot walks as long as a test of this file is to come.


def test_written_step_length_changes_the_measured_hip_range(walking: Bench) -> None:
    before = hip_range(walking)
    assert before > 0.2
    set_step_length(walking, 0.3, 0.2)
    until(lambda: hip_range(walking) < 0.75 * before)
    set_step_length(walking, 0.3, 0.4)


def test_refused_write_leaves_the_gait_as_it_was(walking: Bench) -> None:
    refused = gwrms("set", "gait.step_length=5", "--robot", walking.address)
    assert refused.returncode == 1
    assert "gait.step_length" in refused.stderr
    assert "Traceback" not in refused.stderr
    read = gwrms("get", "gait.step_length", "--robot", walking.address, "--json")
    assert json.loads(read.stdout)["values"]["gait.step_length"]["value"] == 0.4


def test_one_line_and_a_half_close_answer_live_values(walking: Bench) -> None:
    stamp_ns = walking.ask("component.snapshot")["stamps_ns"]["left_hip.position"]

    def live() -> bool:
        found = walking.ask("component.snapshot")
        values = [found["values"][name] for name in ("left_hip.position", *FORCES)]
        return None not in values and bool(found["stamps_ns"]["left_hip.position"] > stamp_ns)

    until(live)
