"""What a scenario sees of a gateway: its values in words, its answers, and that it is gone."""

import json
import socket
import threading
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import pytest

from hil_sim.clock import MILLISECOND_NS, Clock
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.loop import Loop
from hil_sim.scenario.expectation import Seen, Track
from hil_sim.scenario.gateway import Answered, GatewayFailed, GatewayLink, Result
from hil_sim.scenario.observer import Observer

DESCRIBED = {
    "channels": [{"name": "left_knee.state", "enum": {"8": "fault"}}, {"name": "left_knee.position"}],
    "guard": {"rules": []},
}
SNAPSHOT = {
    "values": {"left_knee.state": 8.0, "left_knee.position": 0.25, "right_knee.position": None},
    "quality": {
        "left_knee": {"state": "fault", "problem": "it is hot"},
        "trunk": {"state": "ok", "problem": None},
    },
}


class FakeLink:
    """Answers at once, and remembers what it was asked."""

    def __init__(self) -> None:
        self.asked: list[tuple[str, Result]] = []
        self.answers: dict[str, Result] = {"robot.describe": DESCRIBED, "component.snapshot": SNAPSHOT}
        self.refused = ""

    def ask(self, method: str, params: Result, answered: Answered) -> None:
        self.asked.append((method, params))
        answered(self.answers.get(method), self.refused)


@pytest.fixture(scope="module")
def robot() -> Exoskeleton:
    return Exoskeleton(Scenario.STAND)


def last(observer: Observer, track: Track) -> dict[str, Seen]:
    return dict(observer.observed[track][-1].values)


def test_values_come_in_words_where_there_are_some(robot: Exoskeleton) -> None:
    observer = Observer(robot, FakeLink())
    robot.clock.run_until(robot.clock.now_ns + 100 * MILLISECOND_NS)
    assert last(observer, Track.CHANNEL) == {
        "left_knee.state": "fault",
        "left_knee.position": 0.25,
        "right_knee.position": None,
    }
    assert last(observer, Track.STATE) == {"left_knee": "fault", "trunk": "ok"}
    assert last(observer, Track.PROBLEM) == {"left_knee": "it is hot", "trunk": ""}
    assert last(observer, Track.TRUTH)["left_knee.nmt"] == "off"


def rule(name: str, state: str, reason: str | None) -> dict[str, object]:
    return {"name": name, "state": state, "reason": reason}


def test_rules_are_seen_with_why_and_whose_stop_is_held(robot: Exoskeleton) -> None:
    link = FakeLink()
    rules = [rule("hot", "tripped", "left_hip: 98 °C"), rule("lost", "watching", None)]
    stop = {"held": True, "reason": "guard rule hot: left_hip: 98 °C"}
    link.answers["robot.describe"] = DESCRIBED | {"guard": {"rules": rules}, "stop": stop}
    observer = Observer(robot, link)
    robot.clock.run_until(robot.clock.now_ns + 100 * MILLISECOND_NS)
    assert last(observer, Track.RULE) == {"hot": "tripped", "lost": "watching"}
    assert last(observer, Track.REASON) == {"hot": "left_hip: 98 °C", "lost": ""}
    assert last(observer, Track.STOP) == {"hot": "guard rule hot: left_hip: 98 °C", "lost": ""}
    stop["held"] = False
    robot.clock.run_until(robot.clock.now_ns + 100 * MILLISECOND_NS)
    assert last(observer, Track.STOP) == {"hot": "", "lost": ""}


def test_without_a_guard_nobody_asks_for_its_rules(robot: Exoskeleton) -> None:
    link = FakeLink()
    Observer(robot, link)
    robot.clock.run_until(robot.clock.now_ns + 300 * MILLISECOND_NS)
    assert [method for method, _ in link.asked].count("robot.describe") == 1


def test_the_next_look_waits_for_the_answer_to_the_last(robot: Exoskeleton) -> None:
    class Slow(FakeLink):
        def ask(self, method: str, params: Result, answered: Answered) -> None:
            self.asked.append((method, params))

    link = Slow()
    observer = Observer(robot, link)
    robot.clock.run_until(robot.clock.now_ns + 500 * MILLISECOND_NS)
    assert [method for method, _ in link.asked] == ["robot.describe", "component.snapshot"]
    assert len(observer.observed[Track.TRUTH]) == 5


def test_a_stop_is_seen_drive_by_drive(robot: Exoskeleton) -> None:
    link = FakeLink()
    observer = Observer(robot, link)
    link.answers["robot.stop"] = {
        "drives": {"left_knee": "confirmed", "left_hip": "unreachable"},
        "held": True,
    }
    observer.ask("stop", "why")
    assert link.asked[-1] == ("robot.stop", {"reason": "why"})
    assert last(observer, Track.ANSWER) == {
        "stop": "done",
        "stop.left_knee": "confirmed",
        "stop.left_hip": "unreachable",
    }


def test_a_write_takes_the_lease_first_and_says_why_it_was_refused(robot: Exoskeleton) -> None:
    link = FakeLink()
    observer = Observer(robot, link)
    link.refused = "out of limit"
    observer.ask("set", {"gait.step_length": 9})
    assert [method for method, _ in link.asked[-2:]] == ["control.acquire", "parameter.write"]
    assert link.asked[-1][1] == {"changes": {"gait.step_length": 9}}
    assert last(observer, Track.ANSWER) == {"set": "out of limit"}


def test_a_gateway_that_refuses_to_be_watched_ends_the_run(robot: Exoskeleton) -> None:
    link = FakeLink()
    link.answers, link.refused = {}, "who are you"
    with pytest.raises(GatewayFailed, match=r"robot\.describe was refused: who are you"):
        Observer(robot, link)


class Server:
    """A gateway of a few lines: answers what it is asked, in pieces, between notifications; then hangs up."""

    def __init__(self, answers: list[dict[str, Any]]) -> None:
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address: tuple[str, int] = self._listener.getsockname()
        self._thread = threading.Thread(target=self._serve, args=(answers,))
        self._thread.start()

    def _serve(self, answers: list[dict[str, Any]]) -> None:
        connection, _ = self._listener.accept()
        with connection, connection.makefile("rb") as lines:
            for answer in answers:
                asked = json.loads(lines.readline())
                line = json.dumps({"jsonrpc": "2.0", "id": asked["id"], **answer}).encode() + b"\n"
                connection.sendall(b'{"jsonrpc": "2.0", "method": "stream.data", "params": {}}\n' + line[:9])
                connection.sendall(line[9:])

    def close(self) -> None:
        self._listener.close()
        self._thread.join()


@pytest.fixture
def loop() -> Iterator[Loop]:
    with closing(Loop(Clock())) as loop:
        yield loop


def test_answers_find_who_asked_and_a_hang_up_is_said(loop: Loop) -> None:
    server = Server([{"result": {"a": 1}}, {"error": {"code": 1, "message": "no"}}])
    found: list[tuple[Result | None, str]] = []
    with closing(server), closing(GatewayLink(loop, server.address)) as link:
        link.ask("one", {}, lambda result, refused: found.append((result, refused)))
        link.ask("two", {"x": 1}, lambda result, refused: found.append((result, refused)))
        with pytest.raises(GatewayFailed, match="closed the connection"):
            loop.run()
    assert found == [({"a": 1}, ""), (None, "no")]
