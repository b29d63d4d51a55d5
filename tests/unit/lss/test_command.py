"""`gwrms lss`: nothing is sent where somebody is at work, nothing is changed without a yes; what is told."""

import io
import json
import threading
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import pytest

import eds
from drivers.bus.bus import CanBus as Bus
from drivers.cli.lss import main
from drivers.errors import NotPermitted, SettingsError
from drivers.lss.surroundings import Surroundings, listen
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


def _has_more(bus: Bus, before: int) -> bool:
    return bus.frames > before


def listen_until_heard(bus: Bus, seconds: float, wait: object) -> Surroundings:
    """As long as a busy computer keeps a device from talking: until one batch of frames was taken."""

    def heard(_seconds: float) -> None:
        for _ in range(2):
            until(partial(_has_more, bus, bus.frames))

    return listen(bus, seconds, heard)


def test_where_somebody_is_at_work_nothing_is_sent_unless_told(
    channel: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("drivers.cli.lss.listen", listen_until_heard)
    done = threading.Event()
    with FakeNode(channel, 9) as worker:

        def work() -> None:
            while not done.wait(0.005):
                worker.heartbeat()

        thread = threading.Thread(target=work)
        thread.start()
        try:
            with pytest.raises(NotPermitted, match="operational: node 9"):
                run(channel, "find")
            assert worker.seen == []
            assert run(channel, "find", "--anyway") == 0
        finally:
            done.set()
            thread.join()
    assert {can_id for can_id, _ in worker.seen} == {0x7E5}


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
