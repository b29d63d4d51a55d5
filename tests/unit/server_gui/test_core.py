"""The server's core without a screen: events in, state out."""

import asyncio
import math
import threading
from collections.abc import Callable, Iterator

import pytest

from gateway.client import Address, Batch, ClockOffset, ConnectionState
from gateway.units import Units
from server_gui.core.follow.events import Event, Failed, LinkChanged, Telemetry
from server_gui.core.follow.feed import Feed, FollowSettings
from server_gui.core.follow.mailbox import Mailbox
from server_gui.core.follow.network import Network
from server_gui.core.follow.robot import Robot
from server_gui.core.tuning.edits import ReviewedEdit, unit_of
from server_gui.core.tuning.stop import StopState
from server_gui.core.tuning.writing import WriteState
from server_gui.terminal.controls import Controls
from server_gui.terminal.followed_robot import FollowedRobot
from server_gui.terminal.keys import Key
from server_gui.terminal.summary import Summary
from tests.fake_robot import FakeRobot
from tests.support import waiting

SECOND_NS = 1_000_000_000


def batch(columns: dict[str, list[float | None]], at_ns: int = 0, dropped: int = 0, missed: int = 0) -> Batch:
    rows = len(next(iter(columns.values()), []))
    return Batch(list(range(rows)), columns, 0, dropped, missed, 1, at_ns)


def telemetry(
    columns: dict[str, list[float | None]], at_ns: int = 0, dropped: int = 0, missed: int = 0
) -> Telemetry:
    return Telemetry(1, batch(columns, at_ns, dropped, missed), None)


# --- state


def test_newest_row_wins_and_null_replaces_a_number() -> None:
    robot = Robot()
    robot.apply(telemetry({"a": [1.0, 2.0]}))
    assert robot.values == {"a": 2.0}
    robot.apply(telemetry({"a": [3.0, None]}))
    assert robot.values == {"a": None}


def test_values_are_stale_half_a_second_after_they_were_taken() -> None:
    robot = Robot()
    assert robot.is_stale(0)
    assert robot.age_s(0) is None
    clock = ClockOffset(-10 * SECOND_NS + SECOND_NS // 10, 0)  # the row was taken at 0 on the robot's clock
    robot.apply(Telemetry(1, batch({"a": [1.0]}, at_ns=10 * SECOND_NS), clock))
    assert not robot.is_stale(10 * SECOND_NS)
    assert robot.age_s(10 * SECOND_NS) == pytest.approx(0.1)
    assert robot.is_stale(10 * SECOND_NS + SECOND_NS // 2)


def test_rate_counts_the_rows_of_the_last_two_seconds() -> None:
    robot = Robot()
    for second in range(10):
        robot.apply(telemetry({"a": [0.0] * 50}, at_ns=second * SECOND_NS))
    assert robot.rate_hz(9 * SECOND_NS + 1) == 50.0
    assert robot.rate_hz(20 * SECOND_NS) == 0.0


def test_a_rate_is_not_known_until_rows_have_come_for_a_while_after_a_new_link() -> None:
    robot = Robot()
    assert robot.rate_text(SECOND_NS) == "– Hz"
    for link in (1, 21):
        robot.apply(LinkChanged(ConnectionState.CONNECTED, None, link * SECOND_NS))
        said = []
        for tenth in range(10 * link, 10 * link + 31):
            at_ns = tenth * SECOND_NS // 10
            robot.apply(Telemetry(1, batch({"a": [0.0] * 10}, at_ns=at_ns), None, asked_hz=100.0))
            said.append(robot.rate_text(at_ns + 1))
        assert list(dict.fromkeys(said)) == ["– Hz", "100 Hz"]
        assert said.count("– Hz") == 20


@pytest.mark.parametrize(("rows", "said"), [(26, "26 of 100 Hz"), (98, "98 Hz")])
def test_a_rate_that_is_lower_than_what_was_asked_for_is_said_with_both(rows: int, said: str) -> None:
    robot = Robot()
    for second in range(1, 6):
        batch_of = batch({"a": [0.0] * rows}, at_ns=second * SECOND_NS)
        robot.apply(Telemetry(1, batch_of, None, asked_hz=100.0))
        if second == 2:
            assert not robot.is_slow(2 * SECOND_NS), "it has only begun"
    assert robot.rate_text(5 * SECOND_NS + 1) == said
    assert robot.is_slow(5 * SECOND_NS + 1) == (" of " in said)


def test_losses_add_up_over_links() -> None:
    robot = Robot()
    robot.apply(telemetry({"a": [1.0]}, dropped=5, missed=1))
    robot.apply(telemetry({"a": [1.0]}, dropped=7))
    robot.apply(telemetry({"a": [1.0]}, dropped=0))
    robot.apply(telemetry({"a": [1.0]}, dropped=2))
    assert (robot.link.dropped, robot.link.missed) == (9, 1)


def test_link_says_why_it_is_down() -> None:
    robot = Robot()
    robot.apply(LinkChanged(ConnectionState.CONNECTED, None, 1))
    robot.apply(LinkChanged(ConnectionState.WAITING, "closed", 2))
    assert (robot.link.state, robot.link.problem, robot.link.links) == (ConnectionState.WAITING, "closed", 1)


# --- mailbox


def test_telemetry_never_pushes_out_what_is_rare() -> None:
    mailbox = Mailbox(telemetry_depth=2)
    mailbox.put(Failed("x", "y"))
    for value in range(5):
        mailbox.put(telemetry({"a": [float(value)]}))
    events = mailbox.drain()
    assert events[0] == Failed("x", "y")
    assert [event.batch.columns["a"] for event in events if isinstance(event, Telemetry)] == [[3.0], [4.0]]
    assert mailbox.drain() == []


# --- summary


def walk(summary: Summary, turns: int) -> None:
    for turn in range(turns):
        left, right = (700.0, 0.0) if turn % 2 else (0.0, 700.0)
        forces: dict[str, list[float | None]] = {"left.force": [left], "right.force": [right]}
        summary.take(batch({**forces, "knee.position": [0.5 * turn]}))


def test_walk_has_no_failures() -> None:
    summary = Summary.of(["knee"], ["left", "right"])
    walk(summary, 6)
    summary.see("knee", "ok")
    assert summary.failures() == []
    assert summary.alternations == 5
    assert summary.feet["left"].loaded_share == pytest.approx(0.5)


def test_joint_that_stands_still_is_named() -> None:
    summary = Summary.of(["knee", "hip"], ["left", "right"])
    walk(summary, 6)
    assert summary.failures() == ["did not move: hip"]


def test_standing_on_both_feet_is_no_walk() -> None:
    summary = Summary.of(["knee"], ["left", "right"])
    for value in range(10):
        summary.take(batch({"left.force": [400.0], "right.force": [350.0], "knee.position": [float(value)]}))
    assert summary.failures() == ["the feet did not alternate"]


def test_component_that_was_lost_once_is_named_also_when_it_came_back() -> None:
    summary = Summary.of(["knee"], ["left", "right"])
    walk(summary, 6)
    for state in ("ok", "lost", "stale", "ok"):
        summary.see("trunk", state)
    assert summary.failures() == ["lost: trunk"]


def test_missing_values_count_for_nothing() -> None:
    summary = Summary.of(["knee"], ["left", "right"])
    summary.take(batch({"left.force": [None], "right.force": [700.0], "knee.position": [None]}))
    assert summary.joints["knee"].low is None
    assert summary.feet["left"].loaded_share is None


# --- feed, against a gateway that speaks the contract


class Watcher:
    """A robot's state, kept up to date in the test's own thread."""

    def __init__(self, fake: FakeRobot, network: Network) -> None:
        self.robot = Robot()
        self.events: list[Event] = []
        self._mailbox = Mailbox()
        following = FollowSettings("test", ("*.position", "*.state"), ("gait.*",))
        self.feed = Feed(Address.parse(fake.address), [self._mailbox.put], following)
        self.following = network.run(self.feed.run())

    def until(self, condition: Callable[[], object]) -> None:
        waiting.until(condition, lambda: self.events[-5:], step=self._take)

    def _take(self) -> None:
        assert not self.following.done()
        for event in self._mailbox.drain():
            self.events.append(event)
            self.robot.apply(event)


@pytest.fixture
def fake() -> Iterator[FakeRobot]:
    with FakeRobot() as fake:
        yield fake


@pytest.fixture
def network() -> Iterator[Network]:
    with Network() as network:
        yield network


def test_a_feed_that_is_left_says_nothing_more(fake: FakeRobot, network: Network) -> None:
    """Another may follow the same robot by then: that the old link is closed is not said of the new one."""
    watcher = Watcher(fake, network)
    watcher.until(lambda: watcher.robot.link.state is ConnectionState.CONNECTED)
    watcher.following.cancel()
    network.run(_ended(watcher.feed)).result(waiting.WAIT_S)
    assert not [one for one in watcher._mailbox.drain() if isinstance(one, LinkChanged)]


async def _ended(feed: Feed) -> None:
    while feed._client.link.state is not ConnectionState.CLOSED:
        await asyncio.sleep(0.001)


def test_feed_tells_what_the_robot_is_and_does(fake: FakeRobot, network: Network) -> None:
    watcher = Watcher(fake, network)
    robot = watcher.robot
    watcher.until(lambda: robot.values and robot.resources and robot.parameters)
    assert robot.word("left_knee.state") == "OPERATION ENABLED"
    assert set(robot.parameters) == {"gait.step_length", "gait.cycle_time"}
    assert "left_insole.force" not in robot.values
    assert robot.names("insole") == ["left_insole", "right_insole"]
    assert not robot.is_stale()
    assert robot.not_ok() == []


def test_feed_goes_on_after_the_link_came_back(fake: FakeRobot, network: Network) -> None:
    watcher = Watcher(fake, network)
    watcher.until(lambda: watcher.robot.values)
    fake.refuse()
    watcher.until(watcher.robot.is_stale)
    assert watcher.robot.link.problem is not None
    fake.boot_id = "boot-2"
    fake.listen()
    watcher.until(lambda: not watcher.robot.is_stale())
    assert watcher.robot.link.links == 2
    assert watcher.robot.description is not None
    assert watcher.robot.description.boot_id == "boot-2"


def test_lost_component_is_named_with_its_reason(fake: FakeRobot, network: Network) -> None:
    watcher = Watcher(fake, network)
    watcher.until(lambda: watcher.robot.values.get("left_knee.position") is not None)
    fake.lost.add("left_knee")
    watcher.until(watcher.robot.not_ok)
    (part,) = watcher.robot.not_ok()
    assert (part.name, part.state, part.problem) == ("left_knee", "lost", "no heartbeat; check its cable")
    watcher.until(lambda: watcher.robot.values["left_knee.position"] is None)


def until(session: FollowedRobot, condition: Callable[[], object]) -> None:
    waiting.until(condition, step=session.update)


@pytest.fixture
def session(fake: FakeRobot) -> Iterator[FollowedRobot]:
    with FollowedRobot(Address.parse(fake.address)) as session:
        until(session, lambda: session.station.robot.parameters and session.is_whole())
        yield session


def press(session: FollowedRobot, key: Key, times: int = 1) -> Controls:
    controls = Controls(session.station)
    for _ in range(times):
        controls.press(key)
    return controls


def test_a_key_writes_and_the_lease_is_given_back(fake: FakeRobot, session: FollowedRobot) -> None:
    press(session, Key.RIGHT)
    station = session.station
    until(session, lambda: station.writing.state is WriteState.DONE)
    until(session, lambda: station.robot.parameters["gait.step_length"].value == 0.42)
    until(session, lambda: station.control.until_ns is None)
    assert len(fake.called("control.release")) == 1


def test_refused_write_is_told_in_the_robots_words(fake: FakeRobot, session: FollowedRobot) -> None:
    station = session.station
    unit = unit_of("gait.step_length", "m", Units())
    station.write((ReviewedEdit("gait.step_length", unit, 0.4, 9.0, elsewhere=False),))
    until(session, lambda: station.writing.state is WriteState.FAILED)
    assert "above 0.6" in station.writing.text


def test_stop_without_a_link_is_told_as_not_confirmed(fake: FakeRobot, session: FollowedRobot) -> None:
    fake.refuse()
    until(session, session.station.robot.is_stale)
    press(session, Key.STOP)
    until(session, lambda: session.station.stopping.state is StopState.NOT_CONFIRMED)
    assert fake.called("robot.stop") == []


def test_network_joins_its_thread_with_work_under_way(fake: FakeRobot) -> None:
    with Network() as network:
        watcher = Watcher(fake, network)
        watcher.until(lambda: watcher.robot.values)
    assert "network" not in {thread.name for thread in threading.enumerate()}
    assert watcher.following.done()


def test_age_counts_the_robots_own_delay(fake: FakeRobot, network: Network) -> None:
    watcher = Watcher(fake, network)
    watcher.until(lambda: any(isinstance(event, Telemetry) for event in watcher.events))
    ages = [event.age_ns for event in watcher.events if isinstance(event, Telemetry)]
    assert all(age is not None and 0 <= age < 30 * SECOND_NS and math.isfinite(age) for age in ages)


@pytest.mark.parametrize("name", ["Exo 1 (Lab)", "exo-01", "Übungsroboter #2, links"])
def test_a_robot_may_call_itself_as_people_do(name: str) -> None:
    with FakeRobot() as robot:
        described = robot.describe() | {"robot": name}
        robot.overrides["robot.describe"] = lambda _params: described
        with FollowedRobot(Address.parse(robot.address)) as followed:
            waiting.until(
                lambda: followed.station.robot.parts,
                lambda: followed.station.robot.last_failure,
                step=followed.update,
            )
            assert followed.station.robot.description is not None
            assert followed.station.robot.description.robot == name
