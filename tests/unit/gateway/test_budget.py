"""The budget: beyond a share of a core streams give way, come back slowly, and say so; nothing else does."""

import itertools
import logging
from collections.abc import Iterator
from pathlib import Path

import pytest

from drivers.component import ComponentKind
from gateway.config import ConfigError
from gateway.main import main
from gateway.modules.component.module import ComponentSource
from gateway.process.loop import Loop
from gateway.streaming import budget
from gateway.streaming.budget import MOST, OVER_LOOKS, UNDER_LOOKS, Budget
from gateway.streaming.feeds import SampleFeed, TickFeed
from gateway.streaming.sources import whole
from tests.support.waiting import until
from tests.unit.gateway.harness import HEAD, ROBOT, Bench, Client, FakeComponent, config, serving
from tests.unit.gateway.test_streams import outlet, rows, taken

MS = 1_000_000


@pytest.fixture
def loop() -> Iterator[Loop]:
    loop = Loop()
    yield loop
    loop.close()


def judged(loop: Loop, *percents: float) -> list[int]:
    """The factor after each look, at most 10 %."""
    one = Budget(loop, 10.0)
    factors = []
    for percent in percents:
        one.judge(percent)
        factors.append(one.factor)
    return factors


def test_one_busy_look_sheds_nothing_and_more_in_a_row_half(loop: Loop) -> None:
    assert judged(loop, 11, 9, 11, 9, 11, 11) == [1, 1, 1, 1, 1, 2]


def test_what_stays_too_much_is_shed_to_the_last_row_that_is_always_sent(loop: Loop) -> None:
    factors = judged(loop, *[20] * 30)
    assert max(factors) == factors[-1] == MOST
    assert [factors.index(2**n) + 1 for n in range(1, 4)] == [OVER_LOOKS * n for n in range(1, 4)]


def test_it_comes_back_only_where_twice_as_much_would_fit_for_a_while(loop: Loop) -> None:
    assert judged(loop, 20, 20, *[6] * 50)[-1] == 2  # within, but twice that is not
    assert judged(loop, 20, 20, *[4] * (UNDER_LOOKS - 1), 6, 4)[-1] == 2
    assert judged(loop, 20, 20, *[4] * UNDER_LOOKS)[-1] == 1
    assert judged(loop, *[0] * 50)[-1] == 1


def test_without_a_most_only_what_cannot_keep_up_is_shed(loop: Loop) -> None:
    one = Budget(loop, None)
    factors = []
    for percent, late_s in (
        [(400, 0.0)] * 3 + [(1, 1.0)] * 4 + [(1, 0.1)] * 9 + [(400, 0.0)] * 2 * UNDER_LOOKS
    ):
        one.judge(percent, late_s)
        factors.append(one.factor)
    assert factors[:7] == [1, 1, 1, 1, 2, 2, 4]
    assert factors[7:16] == [4] * 9
    assert factors[-1] == 1
    assert one.info is None


def test_feeds_say_how_late_they_were_once(loop: Loop) -> None:
    feed = TickFeed(loop, [whole(ComponentSource(knee()))], 100.0)
    feed._next_ns -= 300 * MS
    feed._tick()
    assert 0.3 <= feed.was_late_s() < 100
    assert feed.was_late_s() == 0.0
    feed.close()


def test_it_looks_only_while_there_are_streams(loop: Loop) -> None:
    one = Budget(loop, 10.0)
    one.watch(on=True)
    one.watch(on=True)
    assert loop._patience_s() is not None
    one.watch(on=False)
    assert loop._patience_s() is None


def knee() -> FakeComponent:
    return FakeComponent("knee", ComponentKind.JOINT, ["position", "torque"])


def test_ticks_come_at_a_part_of_their_rate_and_never_below_one_a_second(loop: Loop) -> None:
    feed = TickFeed(loop, [whole(ComponentSource(knee()))], 100.0)
    one = outlet()
    feed.outlets.append(one)
    feed.shed_to(4)
    feed._next_ns -= 200 * MS
    feed._tick()
    data = taken(one)
    assert {one["shed"] for one in data} == {4}
    stamps = [stamp_ns for stamp_ns, _ in rows(data)]
    assert {b - a for a, b in itertools.pairwise(stamps)} == {40 * MS}
    feed.shed_to(1)
    feed._next_ns -= 100 * MS
    feed._tick()
    after = taken(one)
    assert after
    assert all("shed" not in each for each in after)
    feed.shed_to(64)
    assert feed.shed == 64
    feed.close()
    slow = TickFeed(loop, [whole(ComponentSource(knee()))], 5.0)
    slow.shed_to(64)
    assert slow.shed == 5
    slow.close()


def test_of_own_samples_every_kind_keeps_its_part(loop: Loop) -> None:
    component = knee()
    feed = SampleFeed(loop, [whole(ComponentSource(component))])
    one = outlet()
    feed.outlets.append(one)
    feed.shed_to(2)
    for stamp_ns in range(8):  # two kinds in turns, as two TPDOs are
        component.latest.update(stamp_ns, (stamp_ns % 2,), (float(stamp_ns),))
    feed._flush()
    data = taken(one)
    assert [one["dropped"] for one in data] == [0] * len(data)
    assert [(stamp_ns, *row) for stamp_ns, row in rows(data)] == [
        (2, "knee.position"),
        (3, "knee.torque"),
        (6, "knee.position"),
        (7, "knee.torque"),
    ]
    feed.close()


def test_a_client_sees_that_rows_are_shed_and_everything_else_is_served(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(budget, "LOOK_S", 0.02)
    robot = config(tmp_path, ROBOT.replace("linger_s", "max_cpu_percent = 0.000001\nlinger_s"))
    with caplog.at_level(logging.WARNING), serving(robot) as address, Client(address) as client:
        client.call("stream.start", modules=["component"], rate_hz=200)
        until(lambda: client.data().get("shed") == MOST, "all that can be is shed")
        assert client.call("robot.describe")["budget"] == {"max_cpu_percent": 0.000001, "shed": MOST}
        cost = client.call("gateway.cost")
        assert cost["clients"][0]["streams"][0]["shed"] == MOST
        assert client.call("robot.stop", reason="test")["drives"]["left_knee"] == "confirmed"
    assert "of a core in all: they now send one row of 2" in caplog.text


def test_describe_shows_the_budget(bench: Bench, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with serving(config(tmp_path, ROBOT.replace("linger_s", "max_cpu_percent = 8\nlinger_s"))) as (
        host,
        port,
    ):
        assert main(["describe", "--robot", f"{host}:{port}"]) == 0
    assert "\nBUDGET  at most 8.0 % of a core\n" in capsys.readouterr().out


def test_watch_says_that_rows_are_shed(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(budget, "LOOK_S", 0.02)
    monkeypatch.setattr(budget, "MOST", 2)
    robot = config(tmp_path, ROBOT.replace("linger_s", "max_cpu_percent = 0.000001\nlinger_s"))
    with serving(robot) as (host, port):
        assert main(["watch", "*", "--robot", f"{host}:{port}", "--rate", "1000", "--count", "500"]) == 0
    assert capsys.readouterr().err == (
        "gwrms watch: the robot sends one row of 2: more would be late, or beyond its max_cpu_percent\n"
    )


def test_a_share_of_nothing_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="max_cpu_percent"):
        config(tmp_path, HEAD.replace("port = 0", "port = 0\nmax_cpu_percent = 0"))
