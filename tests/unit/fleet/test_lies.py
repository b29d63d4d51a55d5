"""A robot that lies: its link says what is wrong, and every other robot's rows go on, exactly once."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from server_gui.core.processing.communication import Health
from tests.fake_robot import FakeRobot
from tests.support.waiting import WAIT_S
from tests.unit.fleet.recording import Kept, recording

Spoil = Callable[[FakeRobot], None]
NOW_NS = 5_000_000_000


@pytest.fixture
def robots() -> Iterator[tuple[FakeRobot, FakeRobot]]:
    with FakeRobot() as bad, FakeRobot() as good:
        yield bad, good


def entry(**fields: Any) -> Spoil:
    """A journal of one entry."""
    sent = {"n": 1, "hash": "h1", "utc_ns": 1, "who": "ada", "what": "write", **fields}

    def spoil(robot: FakeRobot) -> None:
        robot.overrides["journal.tail"] = lambda params: {"entries": [sent]}

    return spoil


def rows(**fields: Any) -> Spoil:
    """A notification of the stream, again and again."""

    def spoil(robot: FakeRobot) -> None:
        data = {
            "stream": 1,
            "seq": 0,
            "dropped": 0,
            "stamp_ns": [NOW_NS],
            "columns": {"trunk.tilt_side": [1]},
        }
        sent = {"jsonrpc": "2.0", "method": "stream.data", "params": data | fields}
        line = json.dumps(sent).replace('"1e999"', "1e999").encode() + b"\n"

        def push(params: dict[str, object]) -> object:
            robot.push(line)
            return robot._resource(params)

        robot.overrides["resource.snapshot"] = push

    return spoil


def deep(robot: FakeRobot) -> None:
    line = b'{"method":"stream.data","params":' + b"[" * 200_000 + b"]" * 200_000 + b"}\n"

    def push(params: dict[str, object]) -> object:
        robot.push(line)
        return robot._resource(params)

    robot.overrides["resource.snapshot"] = push


def channel(**fields: Any) -> Spoil:
    """A description with another channel."""

    def spoil(robot: FakeRobot) -> None:
        described = robot.describe()
        more = {"name": "trunk.more", "unit": "rad", "component": "trunk", "quantity": "more", **fields}
        described["channels"].append(more)
        robot.overrides["robot.describe"] = lambda params: described

    return spoil


def crowd(robot: FakeRobot) -> None:
    described = robot.describe()
    described["channels"] = [
        {"name": f"c.q{number}", "unit": "", "component": "c", "quantity": "q"} for number in range(5000)
    ]
    robot.overrides["robot.describe"] = lambda params: described


def early(robot: FakeRobot) -> None:
    described = robot.describe()
    described["clock"]["utc_ns"] = 0
    robot.overrides["robot.describe"] = lambda params: described


def process(**fields: Any) -> Spoil:
    def spoil(robot: FakeRobot) -> None:
        def look(params: dict[str, object]) -> object:
            found = robot._resource(params)
            found["processes"][0] |= fields
            return found

        robot.overrides["resource.snapshot"] = look

    return spoil


def named(name: str) -> Callable[[FakeRobot], None]:
    def spoil(robot: FakeRobot) -> None:
        described = robot.describe() | {"robot": name}
        robot.overrides["robot.describe"] = lambda params: described

    return spoil


LIES = {
    "hash is an object": (entry(hash={"a": 1}), "the hash of entry 1 of its journal is no text"),
    "hash is null": (entry(hash=None), "entries without a number or a hash"),
    "hash is huge": (entry(hash="x" * 1000), "is longer than 128 letters"),
    "hash has an escape": (entry(hash="\x1b[2J"), "cannot be printed"),
    "n is huge": (entry(n=2**70), "its journal has an entry with the number"),
    "n needs more than 63 bits": (entry(n=2**63 + 5), "its journal has an entry with the number"),
    "n is a word": (entry(n="1"), "its journal has an entry with the number"),
    "n is zero": (entry(n=0), "its journal has an entry with the number 0 after 0"),
    "utc is a word": (entry(utc_ns="now"), "the time of entry 1 of its journal is no whole number"),
    "utc is huge": (entry(utc_ns=2**70), "larger than 8 bytes hold"),
    "who is an object": (entry(who={}), "`who` of entry 1 of its journal is no text"),
    "an entry is long": (entry(more="x" * 100_000), "at most 65536 are kept"),
    "an entry is deep": (entry(more=json.loads("[" * 50 + "]" * 50)), "more than 16 deep"),
    "a channel that was never described": (
        rows(columns={f"x{number}.y": [1.0] for number in range(2000)}),
        "rows have 2000 channels that it never described, such as 'x0.y'",
    ),
    "stamps and values": (rows(stamp_ns=[1, 2]), "2 stamps, but 1 values of a channel"),
    "seq is huge": (rows(seq=2**70), "larger than 8 bytes hold"),
    "a stamp is huge": (rows(stamp_ns=[2**63]), "larger than 8 bytes hold"),
    "dropped is huge": (rows(dropped=2**70), "larger than can be"),
    "shed is negative": (rows(shed=-1), "a count of notifications or rows is negative"),
    "a stamp from nowhere": (rows(stamp_ns=[2**61]), "more than a year from now"),
    "a path as a name": (channel(name="../../etc/passwd"), "is no name of a channel"),
    "a newline in a name": (channel(name="a\nb"), "is no name of a channel"),
    "an escape in a name": (channel(name="a\x1b[31m"), "is no name of a channel"),
    "markup in a name": (channel(name="<b>a</b>"), "is no name of a channel"),
    "a long name": (channel(name="a" * 1000), "is no name of a channel"),
    "markup as what it calls itself": (named("<b>exo</b>"), "is no name of the robot"),
    "an escape in what it calls itself": (named("exo \x1b[2J"), "is no name of the robot"),
    "a long unit": (channel(unit="m" * 1000), "the unit of trunk.more is longer than 32 letters"),
    "20,000 columns": (crowd, "more than 4096 different channels"),
    "a process with a huge number": (process(pid=2**70), "larger than 8 bytes hold"),
    "a process with a long name": (process(name="x" * (5 << 20)), "at most 4194304 are kept"),
    "a calendar from 1970": (early, "set its clock"),
    "values within values": (deep, "does not speak as a gateway does"),
    "a number beyond all": (
        rows(columns={"trunk.tilt_side": ["1e999"]}),
        "sent stream data that cannot be read",
    ),
}


@pytest.mark.parametrize(("spoil", "words"), LIES.values(), ids=LIES)
def test_the_link_of_a_robot_that_lies_says_so_and_the_others_go_on(
    robots: tuple[FakeRobot, FakeRobot], tmp_path: Path, spoil: Spoil, words: str
) -> None:
    bad, good = robots
    spoil(bad)
    with recording(tmp_path, {"bad": bad.address, "good": good.address}) as fleet:

        def told() -> bool:
            link = fleet.fleet.report()["bad"]
            return any(words in reason for reason in (*link.quality.reasons, link.problem or ""))

        fleet.until(told)
        fleet.until_more("good")
        assert fleet.fleet.report()["bad"].quality.health is not Health.GOOD
        assert not any(words in reason for reason in fleet.fleet.report()["good"].quality.reasons)
        assert fleet.recorder.flush(WAIT_S)
        assert (fleet.recorder.state.lost, fleet.recorder.state.alarms) == (0, ())
    kept = Kept.of(tmp_path)
    assert kept.is_whole("good")
    assert {kind for kind, _ in kept.events("good")} <= {"name"}
    described = set(good.values())
    assert {name for run in kept.runs for name in run.layout.channels} <= described
