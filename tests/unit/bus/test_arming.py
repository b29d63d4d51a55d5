"""Arming: a free entry of 1016h, a drive that acts by 6007h, both as the drive itself confirms them."""

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from itertools import groupby

import can
import pytest

from drivers.bus import arming as armings
from drivers.bus.arming import Arming
from drivers.bus.bus import CanBus
from drivers.bus.heartbeat import Heartbeat
from drivers.bus.node import Node, shared_node
from drivers.bus.settings import CanSettings, NodeTimes
from drivers.errors import DriverError, Mismatch
from eds import Description
from tests.support.waiting import WAIT_S, until
from tests.unit.bus.conftest import IDENTITY
from tests.unit.bus.fake_node import FakeNode

Describe = Callable[[int], Description]
Values = dict[int, int]

OURS = 100 << 16 | 250  # node 100, 2.5 times 100 ms
THEIRS = 16 << 16 | 500


@pytest.fixture(autouse=True)
def often(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(armings, "CHECK_S", 0.05)


def consumer(*entries: int) -> dict[tuple[int, int], bytes]:
    """1016h with these entries."""
    table = {(0x1016, at): value.to_bytes(4, "little") for at, value in enumerate(entries, start=1)}
    return {(0x1016, 0): bytes([len(entries)]), **table}


def option(value: int, axis: int = 0) -> dict[tuple[int, int], bytes]:
    return {(0x6007 + axis * 0x800, 0): value.to_bytes(2, "little", signed=True)}


def entry(fake: FakeNode, number: int) -> int:
    return int.from_bytes(fake.objects[0x1016, number], "little")


class Bench:
    """A drive that is armed over a bus of its own."""

    def __init__(self, channel: str, description: Description, fake: FakeNode, axes: tuple[int, ...]) -> None:
        self.fake = fake
        self.bus = CanBus("main", CanSettings(interface="virtual", channel=channel, node_id=100))
        self.heartbeat = Heartbeat(self.bus, 0.1)
        self.node: Node = shared_node(self.bus, 5, description, NodeTimes(sdo_timeout_s=1.0))
        self.changes: list[tuple[bool, str]] = []
        self.arming = Arming(self.node, self.heartbeat, axes, self.changed)

    def changed(self) -> None:
        self.changes.append((self.arming.armed, self.arming.text))

    def until_said(self, *words: str) -> None:
        until(lambda: all(word in self.arming.text for word in words), lambda: self.arming.text)


@pytest.fixture
def bench(channel: str, describe: Describe) -> Callable[..., object]:
    @contextmanager
    def make(objects: dict[tuple[int, int], bytes], axes: tuple[int, ...] = (0,)) -> Iterator[Bench]:
        with FakeNode(channel, 5, {**IDENTITY, **objects}) as fake:
            bench = Bench(channel, describe(5), fake, axes)
            bench.heartbeat.start()
            bench.arming.start()
            try:
                yield bench
            finally:
                bench.arming.stop()
                bench.heartbeat.stop()

    return make


Make = Callable[..., AbstractContextManager[Bench]]


@pytest.mark.parametrize("reaction", [1, 2, 3])
def test_the_first_free_entry_is_taken_and_read_back(bench: Make, reaction: int) -> None:
    with bench({**consumer(THEIRS, 0, 0), **option(reaction)}) as found:
        until(lambda: found.arming.armed)
        assert [entry(found.fake, at) for at in (1, 2, 3)] == [THEIRS, OURS, 0]
        assert found.arming.text == "armed by 1016h:2, 250 ms"


def test_it_is_armed_only_when_it_has_heard_us_after_its_entry_was_written(
    bench: Make, channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A consumer watches from the first heartbeat on that it receives (CiA 301 §7.2.8.3.2.2)."""
    monkeypatch.setattr("drivers.bus.cycles.Cycles.start", lambda _cycles: None)  # ours would come much later
    with bench({**consumer(0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        later = time.monotonic() + 4 * armings.CHECK_S
        until(lambda: time.monotonic() > later)
        assert found.fake.seen.count((0x764, b"\x05")) == 1
        written = next(at for at, (_, data) in enumerate(found.fake.seen) if data[:4] == b"\x23\x16\x10\x01")
        assert found.fake.seen.index((0x764, b"\x05")) > written


def test_an_entry_of_ours_is_taken_up_again_and_not_written_twice(bench: Make) -> None:
    with bench({**consumer(0, OURS), **option(3)}) as found:
        until(lambda: found.arming.armed)
        assert "1016h:2" in found.arming.text
        assert not [write for write in found.fake.writes if write[0] == 0x1016]


def test_an_entry_of_ours_with_another_time_is_corrected(bench: Make) -> None:
    with bench({**consumer(0, 100 << 16 | 7000), **option(3)}) as found:
        until(lambda: found.arming.armed)
        assert [entry(found.fake, at) for at in (1, 2)] == [0, OURS]


@pytest.mark.parametrize(
    ("objects", "words"),
    [
        ({**consumer(0), **option(0)}, ("6007h is 0", "keep moving")),
        ({**consumer(0), **option(-1)}, ("6007h is -1", "nobody knows")),
        ({**consumer(0), **option(4)}, ("6007h is 4", "nobody knows")),
        (consumer(0), ("does not tell what it does when communication is lost",)),
        (option(3), ("has no 1016h",)),
        ({**consumer(), **option(3)}, ("all 0 entries",)),
        ({**consumer(THEIRS, 17 << 16 | 9), **option(3)}, ("all 2 entries", "nodes 16, 17")),
    ],
)
def test_a_drive_that_would_not_stop_is_not_armed_and_it_is_said_why(
    bench: Make, objects: dict[tuple[int, int], bytes], words: tuple[str, ...]
) -> None:
    with bench(objects) as found:
        found.until_said("not armed", *words)
        assert found.arming.armed is False
        assert found.node.ready, "the drive is served all the same"
        assert not found.fake.writes


def test_a_drive_of_another_make_than_its_eds_is_not_armed(bench: Make) -> None:
    with bench({**consumer(0), **option(3), (0x1018, 2): b"\x43\0\0\0"}) as found:
        found.until_said("not armed", "1018h product code is 0x43", "nothing is written to it")
        assert not found.fake.writes


def test_two_drives_with_one_node_id_are_not_armed(bench: Make) -> None:
    with bench({**consumer(0), **option(0)}) as found:
        found.until_said("6007h is 0")
        found.fake.repeat_replies = 2
        found.until_said("not armed", "two devices answer as node 5")
        found.fake.objects.update(option(3))
        found.until_said("not armed", "two devices answer as node 5")
        assert not found.fake.writes
        found.fake.repeat_replies = 1
        until(lambda: found.node.upload(0x1000, 0).result(WAIT_S) and found.arming.armed)


def test_each_axis_of_a_drive_must_act(bench: Make) -> None:
    with bench({**consumer(0), **option(3), **option(0, axis=1)}, axes=(0, 0x800)) as found:
        found.until_said("6807h is 0")
        found.fake.objects.update(option(1, axis=1))
        until(lambda: found.arming.armed)


def test_a_drive_that_holds_another_value_is_not_armed(bench: Make) -> None:
    with bench({**consumer(0), **option(0)}) as found:
        found.until_said("6007h is 0")
        found.fake.on_write = lambda index, subindex, data: found.fake.objects.update(consumer(5))
        found.fake.objects.update(option(3))
        until(lambda: any("holds 0x00000005" in text for _, text in found.changes), lambda: found.changes)
        assert not any(armed for armed, _ in found.changes)


def test_a_drive_that_aborts_the_write_is_not_armed(bench: Make) -> None:
    with bench({**consumer(0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        found.fake.objects.update(consumer(0))
        found.fake.aborts[0x1016, 1] = 0x0601_0002
        found.until_said("not armed", "read-only")


def test_a_rebooted_drive_is_armed_again(bench: Make) -> None:
    with bench({**consumer(0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        found.fake.objects.update(consumer(0))
        found.fake.boot_up()
        until(
            lambda: (
                [armed for armed, _ in groupby(armed for armed, _ in found.changes)] == [True, False, True]
            )
        )
        assert entry(found.fake, 1) == OURS


def test_a_drive_whose_entry_somebody_took_away_is_armed_again(bench: Make) -> None:
    with bench({**consumer(0, 0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        found.fake.objects.update(consumer(THEIRS, 0))
        until(lambda: entry(found.fake, 2) == OURS)
        assert entry(found.fake, 1) == THEIRS


def test_a_drive_that_was_told_to_keep_moving_is_armed_no_longer(bench: Make) -> None:
    with bench({**consumer(0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        found.fake.objects.update(option(0))
        found.until_said("not armed", "6007h is 0")
        assert found.arming.armed is False


def test_nobody_relies_on_a_heartbeat_that_somebody_else_sends_too(bench: Make, channel: str) -> None:
    with bench({**consumer(0), **option(3)}) as found, can.Bus(channel, "virtual") as third:
        until(lambda: found.arming.armed)
        third.send(can.Message(arbitration_id=0x764, data=b"\x05", is_extended_id=False))
        found.until_said("not armed", "somebody else", "node 100")


def test_disarming_frees_our_entry_alone_and_is_read_back(bench: Make) -> None:
    with bench({**consumer(THEIRS, 0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        found.arming.disarm().result()
        assert [entry(found.fake, at) for at in (1, 2)] == [THEIRS, 0]
        assert found.arming.armed is False
        asked = len(found.fake.requests)
        later = time.monotonic() + 4 * armings.CHECK_S
        until(lambda: time.monotonic() > later)
        assert len(found.fake.requests) == asked, "it looks no more"


def test_disarming_a_drive_that_was_never_armed_writes_nothing(bench: Make) -> None:
    with bench({**consumer(THEIRS), **option(3)}) as found:
        found.until_said("not armed", "taken")
        found.arming.disarm().result()
        assert not found.fake.writes


def test_a_drive_that_does_not_confirm_that_it_is_free_is_taken_for_armed(bench: Make) -> None:
    with bench({**consumer(0), **option(3)}) as found:
        until(lambda: found.arming.armed)
        found.fake.on_write = lambda index, subindex, data: found.fake.objects.update(consumer(OURS))
        with pytest.raises(Mismatch):
            found.arming.disarm().result()
        assert found.arming.armed is True
        found.fake.silent = True
        with pytest.raises(DriverError):
            found.arming.disarm().result()
