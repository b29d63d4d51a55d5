"""The guard as it runs: without clients, stopping in the thread that sees, never flooding, open to all."""

import logging
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from drivers.bus.liveness import NodeLife
from drivers.component import ComponentKind
from gateway.cli.describe import main as describe
from gateway.connections.listeners import listen
from gateway.daemon import Daemon
from gateway.guard import alarms
from gateway.guard.armed_drives import ArmedDrives
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import ENABLED, ROBOT, Bench, Client, config, serving

LIMIT = """
[guard.rule.knees]
watch = "joint_limit"
min = -0.1
max = 2.0
clear_s = 0.05
actions = ["quick_stop", "revert_trials", "alarm"]
"""
FOOT = """
[guard.rule.foot]
watch = "insole_stale"
silent_s = 0.2
clear_s = 0.05
"""
LOST = """
[guard.rule.lost]
watch = "node_lost"
on = ["left_knee"]
clear_s = 0.05
actions = ["quick_stop"]
"""
EMERGENCY = """
[guard.rule.emergency]
watch = "emcy"
on = ["*_knee"]
codes = ["0x23"]
clear_s = 0.05
actions = ["quick_stop", "alarm"]
"""
Serve = Callable[[str], "Client"]


@pytest.fixture
def bench(bench: Bench) -> Bench:
    """The fakes, with the life that a node on a bus has."""
    for one in (bench.left, bench.right, bench.gait):
        node: Any = one.node
        node.life, node.description = NodeLife(0.25), SimpleNamespace(vendor_id=None)
        node.life.on_heartbeat(time.monotonic_ns(), b"\x05")
        vars(one)["settings"] = SimpleNamespace(lost_after_s=2.0)
    vars(bench.insole)["settings"] = SimpleNamespace(stale_after_s=0.5)
    return bench


@pytest.fixture
def serve(bench: Bench, tmp_path: Path) -> Iterator[Callable[[str], Client]]:
    """A gateway with these rules, and a client once the guard runs."""
    with ExitStack() as stack:

        def start(rules: str) -> Client:
            client = stack.enter_context(guarding(tmp_path, rules))
            until(lambda: guard(client)["rules"], "the guard runs")
            return client

        yield start


@contextmanager
def guarding(folder: Path, rules: str) -> Iterator[Client]:
    with serving(config(folder, ROBOT + rules)) as address, Client(address) as client:
        yield client


def guard(client: Client) -> dict[str, Any]:
    info: dict[str, Any] = client.call("robot.describe")["guard"]
    return info


def state(client: Client, rule: str) -> str:
    return str({one["name"]: one["state"] for one in guard(client)["rules"]}[rule])


def journal(client: Client, what: str = "") -> list[dict[str, Any]]:
    entries = client.call("journal.tail", n=1000)["entries"]
    return [one for one in entries if not what or one["what"] == what]


def lasted_s(words: str, client: Client) -> float:
    """How long the first alarm says that it lasted, by these words."""
    reason: str = journal(client, "alarm")[0]["reason"]
    found = re.fullmatch(rf"{re.escape(words)} (\d+\.\d+) s", reason)
    assert found is not None, reason
    return float(found[1])


def bend(bench: Bench, position: float) -> None:
    """The left knee says where it is."""
    bench.left.give(position, None)


def life(bench: Bench) -> NodeLife:
    found: NodeLife = vars(bench.left.node)["life"]
    return found


def emcy(bench: Bench, code: int) -> None:
    life(bench).on_emcy(time.monotonic_ns(), code.to_bytes(2, "little") + bytes(6))


def test_it_runs_without_any_client_and_as_long_as_the_gateway(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, ROBOT + LIMIT)) as address:
        until(lambda: bench.left.started, "started by the gateway itself")
        with Client(address) as client:
            until(lambda: guard(client)["rules"], "the guard runs")
            client.call("component.snapshot")
        later = time.monotonic() + 0.3  # long after linger_s
        until(lambda: time.monotonic() > later)
        assert bench.left.stopped == 0
        bend(bench, 2.1)
        until(lambda: min(bench.left.stops, bench.right.stops) >= 1, "stopped")
    assert bench.left.stopped == 1


def test_without_the_table_nothing_of_it_is_loaded_and_nothing_runs(tmp_path: Path) -> None:
    """The gateway in a process of its own, asked for all it can tell."""
    (tmp_path / "robot.toml").write_text(ROBOT, encoding="utf-8")
    script = f"""
import sys, threading
from pathlib import Path
from gateway.config import load
from gateway.daemon import Daemon
from gateway.connections.listeners import listen
from tests.unit.gateway.harness import Client
daemon = Daemon(load(Path({str(tmp_path / "robot.toml")!r})), listen("127.0.0.1", 0))
thread = threading.Thread(target=daemon.run)
thread.start()
with Client(daemon.address) as client:
    assert client.call("robot.describe")["guard"]["configured"] is False
daemon.end()
thread.join()
print(*sorted(name for name in sys.modules if name.startswith(("gateway.guard.", "gateway.config.guard"))))
"""
    shown = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert shown.stdout.split() == []


class TestTrip:
    def test_a_stop_is_held_before_the_frame_s_own_thread_goes_on_and_every_drive_is_stopped(
        self, serve: Serve, bench: Bench
    ) -> None:
        client = serve(LIMIT)
        bend(bench, 2.0)
        assert (bench.left.stops, bench.right.stops) == (0, 0)
        bend(bench, 2.001)
        assert client.call("robot.describe")["stop"]["held"] is True
        until(lambda: min(bench.left.stops, bench.right.stops) >= 1, "stopped")

    def test_the_stop_does_not_wait_for_a_loop_that_is_busy(
        self, serve: Serve, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        client = serve(LIMIT)
        busy, released = threading.Event(), threading.Event()

        def hang() -> None:
            busy.set()
            released.wait(WAIT_S)

        monkeypatch.setattr("gateway.service.Service._clock", lambda _self: hang())
        client.request("clock.read")
        assert busy.wait(WAIT_S)
        bend(bench, 2.5)
        until(lambda: min(bench.left.stops, bench.right.stops) >= 1, "stopped though the loop hangs")
        released.set()
        until(lambda: client.call("robot.describe")["stop"]["held"], "the stop is held")

    def test_the_stop_is_held_with_its_reason_and_written_down(self, serve: Serve, bench: Bench) -> None:
        client = serve(LIMIT)
        bend(bench, 2.5)
        held = until(lambda: client.call("robot.describe")["stop"]["reason"], "held, and why")
        reason = "left_knee.position: 2.5 rad, below -0.1 rad or above 2 rad"
        assert held == f"guard rule knees: {reason}"
        until(lambda: journal(client, "stop answered") and journal(client, "alarm"), "both are told")
        found = {one["what"]: one for one in journal(client) if one["who"] == "guard"}
        assert found["alarm"]["reason"] == reason
        assert found["alarm"]["about"] == "knees"
        assert found["stop answered"]["result"] == {"left_knee": "confirmed", "right_knee": "confirmed"}

    def test_a_drive_enabled_again_is_stopped_again(self, serve: Serve, bench: Bench) -> None:
        client = serve(LIMIT)
        bend(bench, 2.5)
        until(lambda: client.call("robot.describe")["stop"]["held"], "held")
        stops = bench.right.stops
        bench.right.set_state(ENABLED)
        until(lambda: bench.right.stops > stops, "stopped again")

    def test_a_driver_that_fails_does_not_keep_the_others_from_stopping(
        self, serve: Serve, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        serve(LIMIT)

        def fail() -> Any:
            raise RuntimeError("driver bug")

        monkeypatch.setattr(bench.left, "quick_stop", fail)
        bend(bench, 2.5)
        until(lambda: bench.right.stops >= 1, "stopped")

    def test_what_is_on_trial_is_taken_back(self, serve: Serve, bench: Bench) -> None:
        client = serve(LIMIT)
        client.call("control.acquire", ttl_s=60)
        client.call("parameter.write", changes={"gait.step_length": 0.45}, trial_s=60)
        assert bench.gait.node.objects[0x2001, 0] == (450).to_bytes(2, "little")
        bend(bench, -0.2)
        until(lambda: bench.gait.node.objects[0x2001, 0] == (400).to_bytes(2, "little"), "taken back")

    def test_an_alarm_alone_stops_nothing(self, serve: Serve, bench: Bench) -> None:
        client = serve(LIMIT.replace('"quick_stop", "revert_trials", ', ""))
        bend(bench, 2.5)
        until(lambda: journal(client, "alarm"), "written down")
        assert (bench.left.stops, bench.right.stops) == (0, 0)
        assert client.call("robot.describe")["stop"]["held"] is False

    def test_it_is_told_when_it_is_over_and_the_stop_stays(
        self, serve: Serve, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(alarms, "SAY_AGAIN_S", 0.0)
        client = serve(LIMIT)
        bend(bench, 2.5)
        until(lambda: state(client, "knees") == "tripped")

        def well() -> bool:
            bend(bench, 1.0)
            return state(client, "knees") == "cleared"

        until(well)
        until(lambda: journal(client, "alarm over"), "told")
        assert client.call("robot.describe")["stop"]["held"] is True


class TestSilence:
    def test_a_lost_node_stops_the_robot_and_is_cleared_when_it_is_back(
        self, serve: Serve, bench: Bench
    ) -> None:
        client = serve(LOST)
        until(lambda: min(bench.left.stops, bench.right.stops) >= 1, "stopped")
        assert state(client, "lost") == "tripped"

        def back() -> bool:
            life(bench).on_heartbeat(time.monotonic_ns(), b"\x05")
            return state(client, "lost") == "cleared"

        until(back)

    def test_a_reboot_stops_the_robot_at_once(self, serve: Serve, bench: Bench) -> None:
        client = serve(LOST)

        def heard() -> bool:
            life(bench).on_heartbeat(time.monotonic_ns(), b"\x05")
            return state(client, "lost") in ("watching", "cleared")

        until(heard)
        stops = bench.right.stops
        life(bench).on_heartbeat(time.monotonic_ns(), b"\x00")
        until(lambda: bench.right.stops > stops, "stopped")

    def test_an_insole_that_goes_silent_is_told(self, serve: Serve, bench: Bench) -> None:
        client = serve(FOOT)
        until(lambda: state(client, "foot") == "tripped", "silent")
        until(lambda: journal(client, "alarm"), "written down")
        assert lasted_s("left_insole: silent for", client) >= 0.2
        assert client.call("robot.describe")["stop"]["held"] is False

    @pytest.mark.parametrize(("policy", "stops"), [("alarm", 0), ("act", 1)])
    def test_a_rule_that_cannot_see_tells_it_and_acts_only_where_it_should(
        self, serve: Serve, bench: Bench, policy: str, stops: int
    ) -> None:
        bench.left.latest.stale_after_ns = bench.right.latest.stale_after_ns = 200_000_000
        client = serve(LIMIT + f'blind = "{policy}"\n')
        bend(bench, 1.0)
        until(lambda: journal(client, "alarm"), "told")
        assert lasted_s("left_knee.position: no value for", client) >= 0.2
        assert min(bench.left.stops, 1) == stops
        assert state(client, "knees") == ("tripped" if stops else "blind")


class TestEmcy:
    def test_its_class_stops_the_robot(self, serve: Serve, bench: Bench) -> None:
        serve(EMERGENCY)
        emcy(bench, 0x8130)
        assert bench.right.stops == 0
        emcy(bench, 0x2310)
        until(lambda: min(bench.left.stops, bench.right.stops) >= 1, "stopped")

    def test_a_storm_neither_floods_the_journal_nor_the_drives(
        self, serve: Serve, bench: Bench, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(alarms, "SAY_AGAIN_S", 1.0)
        client = serve(EMERGENCY)
        began = time.monotonic()
        for _ in range(5):
            for _ in range(1000):
                emcy(bench, 0x2310)
            emcy(bench, 0x0000)
            until(lambda: self.is_over(client, bench), "over")
        took_s = time.monotonic() - began
        told = [one for one in journal(client) if one.get("about") == "emergency"]
        assert guard(client)["rules"][0]["trips"] == 5
        assert 1 <= len(told) <= 2 + took_s
        assert len(journal(client, "stop")) == 1
        assert bench.left.stops <= 5 + len(journal(client, "stop"))
        until(lambda: any(one.get("left_out") for one in journal(client)), "what was left out is counted")

    @staticmethod
    def is_over(client: Client, bench: Bench) -> bool:
        for one in (bench.left, bench.right):
            vars(one.node)["life"].on_heartbeat(time.monotonic_ns(), b"\x05")
        return state(client, "emergency") == "cleared"


class TestOpen:
    """What everybody can see of it."""

    def test_describe_tells_each_rule_and_what_it_cannot_see(self, serve: Serve, bench: Bench) -> None:
        hot = '\n[guard.rule.hot]\nwatch = "temperature"\nabove = 80\non = ["left_knee"]\n'
        any_hot = hot.replace("rule.hot", "rule.any_hot").replace('on = ["left_knee"]\n', "")
        info = guard(serve(LIMIT + hot + any_hot))
        assert info["configured"] is True
        knees, hot_knee, any_knee = info["rules"]
        assert (knees["name"], knees["watch"], knees["state"]) == ("knees", "joint_limit", "watching")
        assert knees["limit"] == "below -0.1 rad or above 2 rad"
        assert knees["on"] == ["left_knee", "right_knee"]
        assert knees["actions"] == ["quick_stop", "revert_trials", "alarm"]
        assert (knees["problems"], knees["reason"], knees["trips"]) == ([], None, 0)
        assert hot_knee["state"] == any_knee["state"] == "blind"
        assert hot_knee["problems"] == ["left_knee: has no temperature"]
        assert any_knee["problems"] == ["the robot: has no temperature"]

    def test_gwrms_describe_shows_it_to_people(
        self, serve: Serve, bench: Bench, capsys: pytest.CaptureFixture[str]
    ) -> None:
        client = serve(LIMIT + FOOT)
        bend(bench, 2.5)
        until(lambda: state(client, "foot") == "tripped" and state(client, "knees") == "tripped")
        host, port = client.socket.getpeername()
        assert describe(["--robot", f"{host}:{port}"]) == 0
        shown = capsys.readouterr().out
        lines = shown[shown.index("GUARD RULE") :].splitlines()
        words = [re.split(r"  +", line) for line in lines[1:]]
        reason = "left_knee.position: 2.5 rad, below -0.1 rad or above 2 rad"
        assert words[0][:3] == ["knees", "joint_limit", "below -0.1 rad or above 2 rad"]
        assert words[0][3:] == ["quick stop, revert trials, alarm", "tripped", reason]
        assert words[1][:5] == ["foot", "insole_stale", "silent for 0.2 s", "alarm", "tripped"]

    def test_a_component_that_could_not_be_built_cannot_be_seen(self, serve: Serve, bench: Bench) -> None:
        bench.absent["left_knee"] = (ComponentKind.JOINT, "its EDS is broken")
        rule = guard(serve(LIMIT))["rules"][0]
        assert (rule["quantities"], rule["low"], rule["high"]) == (["position"], -0.1, 2.0)
        assert rule["state"] == "blind"
        assert rule["problems"] == ["left_knee: is not there: its EDS is broken"]

    def test_its_channels_are_in_every_snapshot_and_stream(self, serve: Serve, bench: Bench) -> None:
        client = serve(LIMIT)
        until(lambda: client.call("component.snapshot", channels=["guard.*"])["values"]["guard.knees"] == 0)
        channels = {one["name"]: one for one in client.call("robot.describe")["channels"]}
        assert channels["guard.knees"]["enum"]["3"] == "tripped"
        client.call("stream.start", modules=["component"], rate_hz=0, channels=["guard.*"])
        bend(bench, 2.5)

        def tripped() -> bool:
            columns = client.data()["columns"]
            return bool(columns["guard.knees"][-1] == 3 and columns["guard.alarms"][-1] == 1)

        until(tripped)

    def test_a_guard_that_cannot_start_is_told_and_tried_again(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("gateway.always_on.AGAIN_S", 0.2)
        works = False

        def start(_armings: ArmedDrives) -> None:
            if not works:
                raise OSError("no such thing")

        monkeypatch.setattr(ArmedDrives, "start", start)
        with guarding(tmp_path, LIMIT) as client:
            until(lambda: "no such thing" in str(guard(client)["problem"]), "it is told")
            works = True
            until(lambda: guard(client)["rules"], "it runs")
            assert guard(client)["problem"] is None

    def test_a_stop_whose_reason_is_still_there_is_not_reset(self, serve: Serve, bench: Bench) -> None:
        client = serve(LIMIT)
        bend(bench, 2.5)
        until(lambda: client.call("robot.describe")["stop"]["held"], "held")
        client.call("control.acquire", ttl_s=60)
        error = client.refused("robot.reset")
        assert error.kind == "stopped"
        assert "knees (left_knee.position: 2.5 rad" in str(error)
        assert client.call("robot.describe")["stop"]["held"] is True

        def well() -> bool:
            bend(bench, 1.0)
            return state(client, "knees") == "cleared"

        until(well)
        assert client.call("robot.reset")["held"] is False


def test_a_gateway_that_ends_as_its_guard_begins_raises_no_alarm_about_it(
    bench: Bench, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    daemon = Daemon(config(tmp_path, ROBOT + FOOT), listen("127.0.0.1", 0))
    daemon.end()
    daemon.run()
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]
