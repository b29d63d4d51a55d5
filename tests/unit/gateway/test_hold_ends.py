"""What ends a held stop when things happen at the same moment, and what keeps it."""

import time
from collections.abc import Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from drivers.component import ComponentKind
from drivers.errors import DeviceTimeout
from drivers.joint.cia402 import DriveState
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.transitions import Led
from gateway.modules.stop.target import Report
from gateway.records.folder import RecordsFolder
from tests.support.waiting import until
from tests.unit.gateway.harness import (
    DISABLED,
    ENABLED,
    HEAD,
    QUICK_STOPPED,
    ROBOT,
    Answered,
    Bench,
    Client,
    config,
    serving,
)

GAIT_COMMAND = (0x2000, 0)
CONTROLLER = """
[[stop.controller]]
component = "gait"
object = "0x2000:0"
value = 0
"""
GUARD = """
[guard.rule.limit]
watch = "joint_limit"
on = ["left_knee"]
max = 2.0
clear_s = 0.001
actions = ["quick_stop"]
"""


@contextmanager
def stopped(folder: Path, more: str) -> Iterator[Client]:
    """A client with the lease, after its stop."""
    text = ROBOT.replace(HEAD, HEAD.replace("port = 0", 'port = 0\nrecords = "records"')) + more
    with serving(config(folder, text)) as address, Client(address) as client:
        client.call("control.acquire", ttl_s=60)
        client.call("robot.stop", reason="test")
        yield client


def held(client: Client) -> bool:
    answer: bool = client.call("robot.describe")["stop"]["held"]
    return answer


@contextmanager
def resetting(client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """While the left knee's way down takes its time; it arrives at the end."""
    led: Future[Led] = Future()
    with monkeypatch.context() as patch:
        patch.setattr(bench.left, "reset", lambda _wanted: led)
        request = client.request("robot.reset")
        until(lambda: bench.right.resets == 1, "it is under way")
        yield request
        bench.left.set_state(DISABLED)
        led.set_result(Led(DriveState.SWITCH_ON_DISABLED))


class TestGuardDuringAReset:
    def test_a_rule_that_trips_and_stands_keeps_the_hold(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with stopped(tmp_path, GUARD) as client:
            until(lambda: client.call("robot.describe")["guard"]["rules"], "the guard runs")
            with resetting(client, bench, monkeypatch) as request:
                stops = bench.right.stops
                bench.left.position = 2.5  # where it stays
                bench.left.give(2.5, None)
                until(lambda: bench.right.stops > stops, "stopped at once")
            assert client.answer(request)["held"] is True
            assert held(client)
            assert client.refused("robot.reset").kind == "stopped"

    def test_one_that_is_over_before_the_reset_ends_was_a_stop_all_the_same(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with stopped(tmp_path, GUARD) as client:
            until(lambda: client.call("robot.describe")["guard"]["rules"], "the guard runs")

            def well() -> bool:
                bench.left.give(0.5, None)
                (rule,) = client.call("robot.describe")["guard"]["rules"]
                return bool(rule["state"] == "cleared")

            with resetting(client, bench, monkeypatch) as request:
                bench.left.give(2.5, None)
                until(well, "it is over")
            assert client.answer(request)["held"] is True
            assert client.call("robot.reset")["held"] is False


class TestControllers:
    def test_one_that_does_not_answer_keeps_the_hold_and_is_named(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        with stopped(tmp_path, CONTROLLER) as client:
            _silence(bench, on=True)
            with monkeypatch.context() as patch:  # it is given up soon, and has its time afterwards
                patch.setattr("gateway.modules.stop.controllers.INSIST_S", 0.1)
                answer = client.call("robot.reset")
            assert (answer["held"], list(answer["problems"])) == (True, ["gait"])
            _silence(bench, on=False)
            assert client.call("robot.reset")["held"] is False

    def test_one_that_is_not_there_keeps_the_hold_and_is_named(self, bench: Bench, tmp_path: Path) -> None:
        bench.absent["gait"] = (ComponentKind.DEVICE, "its EDS is broken")
        with stopped(tmp_path, CONTROLLER) as client:
            answer = client.call("robot.reset")
        assert answer["held"] is True
        assert "not there" in answer["problems"]["gait"]

    def test_one_that_goes_on_by_itself_keeps_the_hold(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("gateway.modules.stop.controllers.INSIST_S", 0.1)
        with stopped(tmp_path, CONTROLLER) as client:
            bench.gait.node.before_upload = lambda _index: bench.gait.node.objects.update(
                {GAIT_COMMAND: b"\x01"}
            )
            assert client.call("robot.reset")["held"] is True

    def test_one_that_was_out_of_reach_is_asked_again_and_again(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("gateway.modules.stop.controllers.INSIST_S", 0.05)
        monkeypatch.setattr("gateway.modules.stop.watch.CONTROLLERS_S", 0.05)
        _silence(bench, on=True)
        with stopped(tmp_path, CONTROLLER):
            bench.gait.node.objects[GAIT_COMMAND] = b"\x01"
            _silence(bench, on=False)
            until(lambda: bench.gait.node.objects[GAIT_COMMAND] == b"\x00", "stopped when it answers")

    def test_one_that_somebody_starts_again_is_stopped_again(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("gateway.modules.stop.watch.CONTROLLERS_S", 0.05)
        with stopped(tmp_path, CONTROLLER):
            for _ in range(2):
                bench.gait.node.objects[GAIT_COMMAND] = b"\x01"
                until(lambda: bench.gait.node.objects[GAIT_COMMAND] == b"\x00", "stopped again")


class TestOvertaken:
    """What came in before a stop, and is handled later."""

    def test_a_reset_is_not_begun(self, bench: Bench, tmp_path: Path) -> None:
        with stopped(tmp_path, "") as client:
            client.send(_lines("robot.reset", "robot.stop"))
            assert client.answer(1001)["held"] is True
            with pytest.raises(Answered, match="the robot was stopped after this was asked for") as refused:
                client.answer(1000)
            assert refused.value.kind == "stopped"
            assert (held(client), bench.left.resets) == (True, 0)
            assert client.call("robot.reset")["held"] is False

    def test_a_reset_leads_nothing_down_after_a_stop(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        hanging: Future[Report] = Future()
        usual, asked = bench.gait.node.run, list[bool]()

        def run(job: Any, *, urgent: bool = False, **how: Any) -> Future[Any]:
            if not urgent or asked:
                return usual(job, urgent=urgent, **how)
            asked.append(True)
            return hanging

        with stopped(tmp_path, CONTROLLER) as client, Client(client.socket.getpeername()) as other:
            monkeypatch.setattr(bench.gait.node, "run", run)
            request = client.request("robot.reset")
            until(lambda: asked, "the controllers are asked first")
            stops = bench.left.stops
            stop = other.request("robot.stop", reason="wait")
            until(lambda: bench.left.stops > stops, "stopped")
            hanging.set_result(Report(StopOutcome.CONFIRMED))
            assert client.answer(request)["held"] is True
            assert other.answer(stop)["held"] is True
            assert (bench.left.resets, bench.right.resets) == (0, 0)

    def test_a_controller_that_boots_after_it_was_read_keeps_the_hold(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        seen: Future[Led] = Future()
        with stopped(tmp_path, CONTROLLER) as client:
            looks = list[bool]()

            def look() -> Future[Led]:
                looks.append(True)
                return seen

            monkeypatch.setattr(bench.left, "look", look)
            request = client.request("robot.reset")
            until(lambda: looks, "it is under way")
            bench.gait.node.life.on_heartbeat(time.monotonic_ns(), b"\x00")
            seen.set_result(Led(DriveState.SWITCH_ON_DISABLED, asked_ns=time.monotonic_ns()))
            answer = client.answer(request)
            assert (answer["held"], list(answer["problems"])) == (True, ["gait"])


def _lines(*methods: str) -> bytes:
    """Requests 1000, 1001, … in one piece."""
    return b"".join(
        b'{"jsonrpc":"2.0","id":%d,"method":"%s","params":{}}\n' % (number, method.encode())
        for number, method in enumerate(methods, 1000)
    )


@pytest.mark.parametrize("statusword", [ENABLED, QUICK_STOPPED])
def test_a_drive_that_was_down_and_is_up_again_keeps_the_hold(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, statusword: int
) -> None:
    """The right knee is down, then enabled by somebody and stopped again, while the left one is led down."""
    with stopped(tmp_path, "") as client:
        with resetting(client, bench, monkeypatch) as request:
            until(lambda: bench.right.node.objects[0x6041, 0] == DISABLED.to_bytes(2, "little"), "down")
            bench.right.set_state(statusword)
        answer = client.answer(request)
        assert answer["held"] is True
        assert answer["drives"]["right_knee"] in ("operation enabled", "quick stop active")
        assert "right_knee" in answer["problems"]


def test_a_drive_that_boots_while_the_others_are_led_down_is_read_anew(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with stopped(tmp_path, "") as client:
        with resetting(client, bench, monkeypatch) as request:
            bench.right.node.life.on_heartbeat(1 << 62, b"\x00")  # later than whatever is read
        assert client.answer(request)["held"] is True


def test_a_second_gateway_does_not_end_the_hold_of_the_first(bench: Bench, tmp_path: Path) -> None:
    with stopped(tmp_path, "") as client:
        with serving(config(tmp_path, client_text())) as address, Client(address) as second:
            second.call("control.acquire", ttl_s=60)
            assert "another gateway" in second.call("robot.stop")["problem"]
            assert second.call("robot.reset")["held"] is False
        assert RecordsFolder(tmp_path / "records").hold.exists()
        assert held(client)


def client_text() -> str:
    return ROBOT.replace(HEAD, HEAD.replace("port = 0", 'port = 0\nrecords = "records"'))


def _silence(bench: Bench, *, on: bool) -> None:
    """Whether the gait controller answers nothing."""

    def silent() -> None:
        if on:
            raise DeviceTimeout("it does not answer")

    bench.gait.node.before_upload = lambda _index: silent()
    bench.gait.node.before_download = lambda _index, _data: silent()
