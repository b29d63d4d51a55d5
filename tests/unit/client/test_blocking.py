"""The face for scripts: five lines, one thread, nothing left behind."""

import signal
import subprocess
import sys
import threading
from collections.abc import Iterator

import pytest

from gateway.client import BadAddress, LinkSettings, RemoteError, Robot, Unreachable
from gateway.client.client import LEASE_MARGIN_S, WRITE_TIMEOUT_S
from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S

PATIENT = LinkSettings(silence_s=30.0)


@pytest.fixture
def fake() -> Iterator[FakeRobot]:
    with FakeRobot() as robot:
        yield robot


def test_script_connects_reads_watches_writes_and_stops(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot:
        assert robot.read("gait.*").values["gait.step_length"].value == 0.40
        batch = next(robot.watch("left_knee.position", rate_hz=50))
        written = robot.write({"gait.step_length": 0.42})
        stopped = robot.stop("script has ended")
    assert list(batch.columns) == ["left_knee.position"]
    assert (written.before, written.after) == ({"gait.step_length": 0.40}, {"gait.step_length": 0.42})
    assert set(stopped.drives.values()) == {"confirmed"}
    assert fake.called("robot.stop") == [{"reason": "script has ended"}]


def test_lease_is_given_back_after_a_refused_write(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot, pytest.raises(RemoteError, match="above"):
        robot.write({"gait.step_length": 9.0})
    order = [name for name, _ in fake.calls if name.startswith(("control.", "parameter."))]
    assert order == ["control.acquire", "parameter.write", "control.release"]


def test_a_trial_holds_the_lease_for_its_own_time_and_gives_it_back(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot:
        with robot.trial({"gait.step_length": 0.42}, trial_s=6) as written:
            *_, longest, held = [call["ttl_s"] for call in fake.called("control.acquire")]
            robot.confirm(written.write)
        assert (longest, held) == (6 + LEASE_MARGIN_S + WRITE_TIMEOUT_S, 6 + LEASE_MARGIN_S)
        assert held < 12, "who asks meanwhile is told about the trial's own time"
        assert len(fake.called("control.release")) == 1


def test_watching_ends_its_stream_when_the_loop_is_left(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot:
        for _, _batch in zip(range(3), robot.watch("*.force", rate_hz=100), strict=False):
            pass
        robot.describe()
        assert len(fake.called("stream.stop")) == 1


def test_unreachable_robot_leaves_no_thread() -> None:
    with FakeRobot() as gone:
        address = gone.address
    before = threading.active_count()
    with pytest.raises(Unreachable):
        Robot(address, PATIENT)
    with pytest.raises(BadAddress):
        Robot("host:port:more")
    assert threading.active_count() == before


def test_closing_twice_is_harmless(fake: FakeRobot) -> None:
    robot = Robot(fake.address, PATIENT)
    robot.close()
    robot.close()


def test_watch_goes_on_over_a_dropped_link(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot:
        stream = robot.watch("left_knee.position", rate_hz=100)
        first = next(stream)
        fake.cut()
        assert next(batch for batch in stream if batch.link > first.link).columns
        stream.close()


def test_where_nothing_comes_a_batch_without_rows_does_if_asked_for(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot:
        stream = robot.watch("left_knee.position", rate_hz=100, idle_s=0.05)
        assert next(batch for batch in stream if batch.stamps_ns).columns
        fake.frozen = True
        assert next(batch for batch in stream if not batch.stamps_ns).columns == {}
        fake.frozen = False
        assert next(batch for batch in stream if batch.stamps_ns).columns
        stream.close()


def test_snapshots_come_typed(fake: FakeRobot) -> None:
    with Robot(fake.address, PATIENT) as robot:
        assert robot.resources().cpu.percent is None
        assert robot.resources().cpu.percent == 21.5
        assert set(robot.components("left_insole.*").values) == {"left_insole.force"}
        assert robot.status().quality["trunk"]["state"] == "ok"
        assert robot.describe().robot == "exo-fake"


INTERRUPTED = """
import signal
import subprocess
import sys
import threading
from gateway.client import Robot

start = threading.Thread.start

def interrupted(self):
    start(self)
    raise KeyboardInterrupt

threading.Thread.start = interrupted
Robot("127.0.0.1:1")
"""


def test_ctrl_c_while_its_thread_starts_ends_the_program() -> None:
    ended = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], stderr=subprocess.DEVNULL, timeout=WAIT_S, check=False
    )
    assert ended.returncode == -signal.SIGINT
