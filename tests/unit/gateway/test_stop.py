"""The stop: every drive at once, without a lease, answered per drive, and held."""

import contextlib
import gc
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from pathlib import Path

import pytest

from drivers.component import ComponentKind
from drivers.joint.quick_stop import StopOutcome
from drivers.joint.reading import DriveReading
from gateway.config import ConfigError
from gateway.modules.stop.drive import is_enabled
from gateway.modules.stop.target import Report
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway.harness import DISABLED, ENABLED, ROBOT, Bench, Client, FakeDrive, config, serving


def test_a_stop_needs_no_lease_and_answers_per_drive(connect: Callable[[], Client], bench: Bench) -> None:
    writer, other = connect(), connect()
    writer.call("control.acquire", ttl_s=60)
    answer = other.call("robot.stop", reason="the patient stumbles")
    assert answer == {
        "drives": {"left_knee": "confirmed", "right_knee": "confirmed"},
        "held": True,
        "controllers": {},
        "fallbacks": {},
        "problem": None,
        "outdated": None,
    }
    assert (bench.left.stops, bench.right.stops) == (1, 1)
    stop = other.call("robot.describe")["stop"]
    assert (stop["held"], stop["reason"]) == (True, "the patient stumbles")
    assert stop["since_ns"] > 0


def test_only_what_is_confirmed_counts_as_stopped(client: Client, bench: Bench) -> None:
    bench.left.stopping = StopOutcome.UNCONFIRMED
    bench.right.stopping = StopOutcome.UNREACHABLE
    drives = client.call("robot.stop", reason="")["drives"]
    assert drives == {"left_knee": "unconfirmed", "right_knee": "unreachable"}


def test_a_drive_that_could_not_be_built_is_unreachable(client: Client, bench: Bench) -> None:
    bench.absent["left_knee"] = (ComponentKind.JOINT, "its EDS is broken")
    assert client.call("robot.stop")["drives"] == {"right_knee": "confirmed", "left_knee": "unreachable"}


def test_a_driver_that_fails_does_not_keep_the_others_from_stopping(
    client: Client, bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*, wake: bool = True) -> Future[StopOutcome]:
        raise RuntimeError("driver bug")

    monkeypatch.setattr(bench.left, "quick_stop", fail)
    assert client.call("robot.stop")["drives"] == {"left_knee": "unreachable", "right_knee": "confirmed"}


def test_a_stop_is_answered_although_a_drive_never_is(bench: Bench, tmp_path: Path) -> None:
    bench.left.hanging = Future()
    with serving(config(tmp_path, ROBOT + "[stop]\ntimeout_s = 0.1\n")) as address, Client(address) as client:
        answer = client.call("robot.stop")
    assert answer["drives"] == {"left_knee": "unconfirmed", "right_knee": "confirmed"}


@pytest.mark.parametrize(
    "line",
    [
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stop"}\n',
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{}}\n',
        b'{"jsonrpc":"2.0","id":1,"method":"robot.stop","params":{"reason":5,"by":"me"}}\n',
    ],
)
def test_a_stop_is_not_refused_for_its_form(client: Client, bench: Bench, line: bytes) -> None:
    client.send(line)
    assert client.answer(1)["drives"]["left_knee"] == "confirmed"


def test_a_drive_enabled_again_is_stopped_again_and_it_is_said(client: Client, bench: Bench) -> None:
    client.call("robot.stop")
    for _ in range(3):
        bench.left.set_state(ENABLED)
        until(lambda: not is_enabled(bench.left.latest.read(1, 0)[0] or 0), "stopped again")
    assert bench.right.stops == 1
    assert client.call("robot.describe")["stop"]["stopped_again"] == {"left_knee": 3, "right_knee": 0}


def test_a_drive_that_nobody_can_see_is_asked_again(client: Client, bench: Bench) -> None:
    bench.left.set_state(DISABLED)
    client.call("robot.stop")
    bench.left.stopping = StopOutcome.UNREACHABLE
    bench.left.latest.clear()
    until(lambda: bench.left.stops >= 3, "asked again and again")


def test_a_drive_that_stays_stopped_is_left_alone(client: Client, bench: Bench) -> None:
    client.call("robot.stop")
    until(lambda: client.call("clock.read")["monotonic_ns"] > _after(client, 0.8), "the watch has looked")
    assert (bench.left.stops, bench.right.stops) == (1, 1)


def _after(client: Client, seconds: float) -> int:
    since_ns: int = client.call("robot.describe")["stop"]["since_ns"]
    return since_ns + round(seconds * 1e9)


def test_a_held_stop_outlives_its_clients(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path)) as address:
        with Client(address) as client:
            client.call("robot.stop", reason="test")
        with Client(address) as client:
            client.call("clock.read")
            until(lambda: client.call("clock.read")["monotonic_ns"] > _after(client, 0.3), "linger_s is over")
        assert bench.left.stopped == 0
        bench.left.set_state(ENABLED)
        until(lambda: bench.left.stops == 2, "stopped again without any client")
        with Client(address) as client:
            assert client.call("robot.describe")["stop"]["held"] is True
    assert bench.left.stopped == 1


def test_a_stop_is_done_although_its_client_vanishes(connect: Callable[[], Client], bench: Bench) -> None:
    client = connect()
    client.request("robot.stop", reason="and gone")
    client.close()
    until(lambda: (bench.left.stops, bench.right.stops) == (1, 1), "stopped")


@pytest.mark.parametrize(
    ("statusword", "enabled"),
    [
        (0x27, True),
        (0x1237, True),
        (0x8637, True),
        (0x07, False),
        (0x40, False),
        (0x23, False),
        (0x08, False),
    ],
)
def test_operation_enabled_is_read_from_the_statusword(statusword: int, enabled: bool) -> None:
    assert is_enabled(statusword) is enabled


CONTROLLER = """
[[stop.controller]]
component = "gait"
object = "0x2000:0"
value = 0
"""
GAIT_COMMAND = (0x2000, 0)


@contextlib.contextmanager
def stopping(tmp_path: Path, stop: str) -> Iterator[Client]:
    with serving(config(tmp_path, f"{ROBOT}[stop]\n{stop}")) as address, Client(address) as client:
        yield client


class TestFallback:
    """What follows where a quick stop is not confirmed: only where the robot's file says so, and told."""

    BOTH = 'fallback = ["disable_voltage", "nmt_stop"]\n'

    @pytest.fixture(autouse=True)
    def stops_once(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """A drive that goes on is stopped again, but not while a busy computer counts what was done."""
        monkeypatch.setattr("gateway.modules.stop.stop_control.LOOK_S", 10 * WAIT_S)

    def reads(self, drive: FakeDrive, abort_connection: int | None) -> None:
        drive.reading = DriveReading((), {}, {"quick_stop": 2, "abort_connection": abort_connection})

    def test_without_a_word_in_the_robots_file_nothing_follows(self, client: Client, bench: Bench) -> None:
        bench.left.stopping = StopOutcome.UNCONFIRMED
        answer = client.call("robot.stop")
        assert (answer["drives"]["left_knee"], answer["fallbacks"]) == ("unconfirmed", {})
        assert (bench.left.limp, bench.left.nmt_stops) == (0, 0)

    def test_a_confirmed_drive_is_never_let_go_limp(self, bench: Bench, tmp_path: Path) -> None:
        bench.left.stopping = StopOutcome.UNCONFIRMED
        self.reads(bench.left, 3)
        with stopping(tmp_path, self.BOTH) as client:
            answer = client.call("robot.stop")
            assert answer["drives"] == {"left_knee": "confirmed", "right_knee": "confirmed"}
            assert list(answer["fallbacks"]) == ["left_knee"]
            assert "the joint is limp" in answer["fallbacks"]["left_knee"]
            told = [one for one in client.call("journal.tail")["entries"] if one["what"] == "stop fallback"]
            assert [(one["drive"], one["result"]) for one in told] == list(answer["fallbacks"].items())
        assert (bench.left.limp, bench.right.limp, bench.left.nmt_stops) == (1, 0, 0)

    def test_nmt_stop_comes_last_and_is_never_confirmed(self, bench: Bench, tmp_path: Path) -> None:
        bench.left.stopping = bench.left.limping = StopOutcome.UNCONFIRMED
        self.reads(bench.left, 3)
        with stopping(tmp_path, self.BOTH) as client:
            answer = client.call("robot.stop")
        assert answer["drives"]["left_knee"] == "unconfirmed"
        first, second = answer["fallbacks"]["left_knee"].split("; ", 1)[0], answer["fallbacks"]["left_knee"]
        assert "voltage was disabled" in first
        assert "NMT stop was sent, which nothing confirms" in second
        assert (bench.left.limp, bench.left.nmt_stops, bench.right.nmt_stops) == (1, 1, 0)

    @pytest.mark.parametrize("option", [0, None, -1, 7])
    def test_no_nmt_stop_where_6007h_is_not_known_to_act(
        self, bench: Bench, tmp_path: Path, option: int | None
    ) -> None:
        bench.left.stopping = StopOutcome.UNREACHABLE
        self.reads(bench.left, option)
        with stopping(tmp_path, 'fallback = ["nmt_stop"]\n') as client:
            answer = client.call("robot.stop")
        assert answer["drives"]["left_knee"] == "unreachable"
        assert "was not sent" in answer["fallbacks"]["left_knee"]
        assert bench.left.nmt_stops == 0

    def test_a_drive_out_of_reach_is_not_asked_to_go_limp(self, bench: Bench, tmp_path: Path) -> None:
        bench.left.stopping = StopOutcome.UNREACHABLE
        with stopping(tmp_path, 'fallback = ["disable_voltage"]\n') as client:
            assert client.call("robot.stop")["drives"]["left_knee"] == "unreachable"
        assert bench.left.limp == 0

    def test_two_axes_of_one_drive_are_silenced_only_if_none_has_confirmed(
        self, bench: Bench, tmp_path: Path
    ) -> None:
        bench.right.node = bench.left.node
        bench.left.stopping = StopOutcome.UNCONFIRMED
        for drive in (bench.left, bench.right):
            self.reads(drive, 3)
        with stopping(tmp_path, 'fallback = ["nmt_stop"]\n') as client:
            assert client.call("robot.stop")["fallbacks"] == {}
            bench.right.stopping = StopOutcome.UNCONFIRMED
            assert list(client.call("robot.stop")["fallbacks"]) == ["left_knee", "right_knee"]
        assert bench.left.nmt_stops + bench.right.nmt_stops == 1

    def test_what_would_follow_is_described_with_what_it_means(self, bench: Bench, tmp_path: Path) -> None:
        with stopping(tmp_path, self.BOTH) as client:
            words = client.call("robot.describe")["stop"]["fallbacks"]
        assert "limp" in words[0]
        assert "nothing confirms" in words[1]


class TestController:
    """Where another controller commands the drives it is stopped too, by its own object."""

    def test_it_is_written_and_read_back(self, bench: Bench, tmp_path: Path) -> None:
        bench.gait.node.objects[GAIT_COMMAND] = b"\x01"
        with stopping(tmp_path, CONTROLLER) as client:
            answer = client.call("robot.stop")
            assert client.call("robot.describe")["stop"]["controllers"] == {"gait": None}
        assert answer["controllers"] == {"gait": "confirmed"}
        assert bench.gait.node.written() == [(0x2000, b"\x00")]

    def test_what_it_does_not_hold_is_not_confirmed(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("gateway.modules.stop.controllers.INSIST_S", 0.1)
        bench.gait.node.store = lambda _index, _data: b"\x01"
        with stopping(tmp_path, CONTROLLER) as client:
            answer = client.call("robot.stop")
        assert answer["controllers"] == {"gait": "unconfirmed"}
        assert answer["drives"] == {"left_knee": "confirmed", "right_knee": "confirmed"}
        assert len(bench.gait.node.written()) > 1

    def test_one_that_is_not_there_is_unreachable(self, bench: Bench, tmp_path: Path) -> None:
        bench.absent["gait"] = (ComponentKind.DEVICE, "its EDS is broken")
        with stopping(tmp_path, CONTROLLER) as client:
            assert client.call("robot.stop")["controllers"] == {"gait": "unreachable"}
            assert "not there" in client.call("robot.describe")["stop"]["controllers"]["gait"]

    @pytest.mark.parametrize(("object_", "value"), [("0x2FFF:0", 0), ("0x2000:0", 300)])
    def test_one_whose_object_cannot_be_written_is_told(
        self, bench: Bench, tmp_path: Path, object_: str, value: int
    ) -> None:
        table = CONTROLLER.replace("0x2000:0", object_).replace("value = 0", f"value = {value}")
        with stopping(tmp_path, table) as client:
            assert client.call("robot.stop")["controllers"] == {"gait": "unreachable"}
            assert object_ in client.call("robot.describe")["stop"]["controllers"]["gait"]

    def test_it_is_asked_once_at_a_time(
        self, bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """One that hangs must not gather what a drive, enabled again and again, would have it do."""
        asked: list[Future[Report]] = []

        def run(_job: object, **_how: object) -> Future[Report]:
            asked.append(Future())
            return asked[-1]

        monkeypatch.setattr(bench.gait.node, "run", run)
        with stopping(tmp_path, "timeout_s = 0.1\n" + CONTROLLER) as client:
            assert client.call("robot.stop")["controllers"] == {"gait": "unconfirmed"}
            for times in range(1, 4):
                bench.left.set_state(ENABLED)
                until(lambda times=times: bench.left.stops > times, "stopped again")  # type: ignore[misc]
            assert len(asked) == 1
            asked[0].set_result(Report(StopOutcome.CONFIRMED))
            assert client.request("robot.stop")
            until(lambda: len(asked) == 2, "and anew once it has answered")
            asked[1].set_result(Report(StopOutcome.CONFIRMED))

    def test_it_is_stopped_again_with_its_drives(self, bench: Bench, tmp_path: Path) -> None:
        with stopping(tmp_path, CONTROLLER) as client:
            client.call("robot.stop")
            bench.gait.node.objects[GAIT_COMMAND] = b"\x01"
            bench.left.set_state(ENABLED)
            until(lambda: bench.gait.node.objects[GAIT_COMMAND] == b"\x00", "stopped again")


@pytest.mark.parametrize(
    ("stop", "complaint"),
    [
        ('fallback = ["nmt_stop", "disable_voltage"]', "NMT stop last"),
        ('fallback = ["disable_voltage", "disable_voltage"]', "each once"),
        ('fallback = ["emergency_stop"]', "fallback"),
        ("timeout_s = 0", "timeout_s"),
        ("timeout_s = 60", "timeout_s"),
        ("time_out_s = 1", "did you mean 'timeout_s'"),
        (CONTROLLER.replace("gait", "left_knee"), "there is no [device.left_knee]: here are gait"),
        (CONTROLLER.replace("0x2000:0", "2000"), "object"),
        (CONTROLLER.replace("0x2000:0", "0x2000:999"), "subindex"),
        (CONTROLLER.replace("value = 0", ""), "value"),
    ],
)
def test_a_stop_table_that_cannot_work_is_refused(tmp_path: Path, stop: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as refused:
        config(tmp_path, f"{ROBOT}[stop]\n{stop}")
    assert complaint in str(refused.value)
    assert "[stop" in str(refused.value)


def test_what_was_read_and_built_is_not_collected_again_and_again_while_the_robot_runs(
    bench: Bench, tmp_path: Path
) -> None:
    """A full collection of a robot's descriptions holds up every thread for 20 ms."""
    gc.unfreeze()
    with serving(config(tmp_path)) as address, Client(address) as client:
        client.call("robot.stop")
        until(lambda: client.call("robot.describe")["modules"]["control"] == "running", "it runs")
        assert gc.get_freeze_count() > 10_000
    assert gc.get_freeze_count() == 0
