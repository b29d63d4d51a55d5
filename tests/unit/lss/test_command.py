"""`gwrms lss`: nothing is sent where somebody is at work, nothing is changed without a yes; what is told."""

import io
import json
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

import eds
from drivers.bus import bus
from drivers.bus.bus import CanBus as Bus
from drivers.bus.frames import Transport
from drivers.bus.interfaces.opening import open_transport
from drivers.bus.settings import CanSettings
from drivers.cli import bit_rate
from drivers.cli.lss import main
from drivers.errors import NotPermitted, SettingsError
from drivers.lss.preconditions import BusSurvey, listen
from hil_sim.bus.can_bus import CanBus
from hil_sim.bus.virtual import VirtualBridge
from hil_sim.clock import Clock
from hil_sim.loop import Loop
from hil_sim.node.node import Node
from tests.support.waiting import until
from tests.unit.bus.fake_node import FakeNode
from tests.unit.hil_sim.device_file import communication

IDENTITY = "0x123:0x456:0x10001:99"  # of `communication()`


@pytest.fixture
def channel(request: pytest.FixtureRequest) -> str:
    return str(request.node.nodeid)


@pytest.fixture
def node(channel: str, tmp_path: Path) -> Iterator[Node]:
    """A simulated device as node 5, alive."""
    clock = Clock()
    bus = CanBus(clock)
    loop, bridge = Loop(clock), VirtualBridge(bus, channel)
    node = Node(clock, bus, "device", 5, eds.load(communication().write(tmp_path), 5))
    node.power_on()
    thread = threading.Thread(target=loop.run)
    thread.start()
    yield node
    loop.stop()
    thread.join()
    bridge.close()
    loop.close()


def run(channel: str, *words: str) -> int:
    action, *others = words
    return main([action, f"virtual:{channel}", *others, "--seconds", "0.05"])


def hears(monkeypatch: pytest.MonkeyPatch, nodes: set[int], since: threading.Event | None = None) -> None:
    """The command listens as long as a busy computer keeps these devices from talking, from an event on."""

    def until_heard(bus: Bus, seconds: float, wait: Callable[[float], object]) -> BusSurvey:
        def again() -> BusSurvey | None:
            found = listen(bus, seconds, wait)
            return found if (since is not None and not since.is_set()) or nodes <= set(found.nodes) else None

        return until(again)

    monkeypatch.setattr("drivers.cli.lss.listen", until_heard)


@contextmanager
def living(
    channel: str, node_id: int, state: int, since: threading.Event | None = None
) -> Iterator[FakeNode]:
    """Another device, which tells its NMT state again and again, from an event on."""
    done = threading.Event()
    with FakeNode(channel, node_id) as other:

        def live() -> None:
            if since is not None:
                since.wait()
            while not done.wait(0.005):
                other.heartbeat(state)

        thread = threading.Thread(target=live)
        thread.start()
        try:
            yield other
        finally:
            done.set()
            if since is not None:
                since.set()
            thread.join()


@pytest.mark.parametrize("device", ["5", IDENTITY, "only"])
def test_a_device_is_meant_by_node_id_identity_or_as_the_only_one(
    channel: str, node: Node, device: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert node.node_id == 5
    assert run(channel, "inquire", device, "--json") == 0
    told = json.loads(capsys.readouterr().out)
    assert (told["identity"], told["serial_number"], told["node_id"]) == (IDENTITY, 99, 5)


def test_what_will_happen_is_told_and_what_has_happened(
    channel: str, node: Node, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(channel, "set", "5", "--node-id", "6", "--new-bitrate", "500000", "--yes") == 0
    lines = capsys.readouterr().out.splitlines()
    name = f"virtual:{channel}"
    assert lines[0] == f"{name}: {IDENTITY}, node 5"
    assert lines[1] == "  it becomes node 6, and stores that"
    assert "NMT to node 5 alone" in lines[2]
    assert lines[5] == f"{name}: it has booted, and says: {IDENTITY}, node 6"
    assert "500000 bit/s stored" in lines[6]
    assert (node.lss.node_id, node.storage.layer_settings(0, 0)) == (6, (6, 500_000))


def test_a_bit_rate_is_activated_where_the_interface_can_follow(
    channel: str, node: Node, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The virtual bus stands for a USB adapter; it changes with the device, as that would by being opened."""
    monkeypatch.setattr(bit_rate, "RATELESS", ())
    monkeypatch.setattr(bit_rate, "SWITCH_MS", 60)
    opened = []

    def wire(settings: CanSettings) -> Transport:
        opened.append(settings.bitrate)
        node._bus.bitrate = settings.bitrate or 0
        return open_transport(settings)

    monkeypatch.setattr(bus, "open_transport", wire)
    words = ("set", "5", "--new-bitrate", "250000", "--activate", "--yes", "--bitrate", "1000000")
    assert run(channel, *words) == 0
    assert capsys.readouterr().out.splitlines()[-1].endswith(f"at 250000 bit/s it says: {IDENTITY}, node 5")
    assert (opened, node.lss.bitrate) == ([1_000_000, 250_000], 250_000)


def test_a_bit_rate_is_not_activated_where_the_interface_is_not_set_from_here(
    channel: str, node: Node
) -> None:
    with pytest.raises(NotPermitted, match="not set from here; without --activate it is stored"):
        run(channel, "set", "5", "--new-bitrate", "250000", "--activate", "--yes", "--bitrate", "1000000")
    assert node.lss.pending_bitrate == 1_000_000


def test_others_are_not_left_behind_at_the_other_rate(
    channel: str, node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bit_rate, "RATELESS", ())
    words = ("set", "5", "--new-bitrate", "250000", "--activate", "--yes", "--bitrate", "1000000")
    hears(monkeypatch, {9})
    with living(channel, 9, 0x7F), pytest.raises(NotPermitted, match="node 9 would stay at the other rate"):
        run(channel, *words)
    assert node.lss.pending_bitrate == 1_000_000


def test_without_a_yes_nothing_is_changed(
    channel: str, node: Node, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(NotPermitted, match="nothing was changed; say --yes"):
        run(channel, "set", "5", "--node-id", "6")
    typed = io.StringIO("n\n")
    monkeypatch.setattr(typed, "isatty", lambda: True)
    monkeypatch.setattr("sys.stdin", typed)
    assert run(channel, "set", "5", "--node-id", "6") == 1
    assert capsys.readouterr().out.endswith("nothing was changed\n")
    assert (node.lss.node_id, node.lss.pending_node_id) == (5, 5)


def test_a_node_id_that_somebody_has_is_given_to_nobody(channel: str, node: Node) -> None:
    other = FakeNode(channel, 6, {(0x1000, 0): bytes(4)})
    with other, pytest.raises(NotPermitted, match="another device has node id 6 already"):
        run(channel, "set", "5", "--node-id", "6", "--yes")
    assert node.lss.pending_node_id == 5


def test_where_somebody_is_at_work_nothing_is_sent_unless_told(
    channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    hears(monkeypatch, {9})
    with living(channel, 9, 0x05) as worker:
        with pytest.raises(NotPermitted, match="operational: node 9"):
            run(channel, "find")
        assert worker.seen == []
        assert run(channel, "find", "--anyway") == 0
    assert {can_id for can_id, _ in worker.seen} == {0x7E5}


def test_who_begins_to_work_while_a_person_thinks_is_not_disturbed(
    channel: str, node: Node, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = threading.Event()

    def readline() -> str:
        begun.set()
        return "y\n"

    monkeypatch.setattr("sys.stdin", SimpleNamespace(isatty=lambda: True, readline=readline))
    hears(monkeypatch, {9}, begun)
    with living(channel, 9, 0x05, begun), pytest.raises(NotPermitted, match="operational: node 9"):
        run(channel, "set", "5", "--node-id", "6")
    assert (node.lss.node_id, node.lss.pending_node_id) == (5, 5)


def test_the_only_device_is_the_only_one(channel: str, node: Node, monkeypatch: pytest.MonkeyPatch) -> None:
    assert node.node_id == 5
    hears(monkeypatch, {8, 9})
    with living(channel, 9, 0x7F) as other, living(channel, 8, 0x7F):
        with pytest.raises(NotPermitted, match="8, 9 are on the bus"):
            run(channel, "inquire", "only", "--anyway")
        assert not {0x7E5} & {can_id for can_id, _ in other.seen}


def test_new_is_refused_where_there_is_none(channel: str, node: Node) -> None:
    assert node.lss.configured
    with pytest.raises(NotPermitted, match="no devices have no node id"):
        run(channel, "set", "new", "--node-id", "6", "--yes")


@pytest.mark.parametrize(
    "words",
    [
        ("find", "5"),
        ("inquire",),
        ("inquire", "5", "--node-id", "6"),
        ("set", "5"),
        ("set", "5", "--node-id", "128"),
        ("set", "5", "--node-id", "0"),
        ("set", "5", "--new-bitrate", "300000"),
        ("set", "5", "--node-id", "6", "--activate"),
        ("set", "5", "--new-bitrate", "500000", "--no-store"),
    ],
)
def test_what_makes_no_sense_is_said_before_anything_is_opened(words: tuple[str, ...]) -> None:
    with pytest.raises(SystemExit) as ended:
        run("nowhere", *words)
    assert ended.value.code == 2


def test_a_device_by_a_word_that_is_none_is_refused(channel: str) -> None:
    with pytest.raises(SettingsError, match="no identity"):
        run(channel, "inquire", "knee")
    with pytest.raises(SettingsError, match="outside 1 to 127"):
        run(channel, "inquire", "200")
