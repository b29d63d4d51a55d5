"""The door of a collector: it answers, and who asks learns whether nobody is there or somebody hangs."""

import asyncio
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from server_gui.core.fleet import control_socket as module
from server_gui.core.fleet.control_socket import NAME, Answers, NobodyCollects, ask, door
from server_gui.core.follow.network import Network


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """One whose name is longer than the address of a socket may be."""
    folder = tmp_path / ("long" * 40)
    folder.mkdir()
    return folder


@pytest.fixture
def network() -> Iterator[Network]:
    with Network() as network:
        yield network


def opened(network: Network, folder: Path, answers: Answers) -> None:
    """A door that stays open until the network ends."""
    ready = threading.Event()

    async def stay() -> None:
        async with door(folder, answers):
            ready.set()
            await asyncio.sleep(3600)

    network.run(stay())
    assert ready.wait(20)


def test_what_is_said_with_a_question_is_handed_on(network: Network, folder: Path) -> None:
    opened(network, folder, {"mark": lambda text: text.upper()})
    assert ask(folder, "mark", "stairs, up") == b'"STAIRS, UP"\n'


def test_a_question_is_answered(network: Network, folder: Path) -> None:
    opened(network, folder, {"status": lambda _: {"rows": 5}})
    assert ask(folder, "status") == b'{"rows":5}\n'
    assert ask(folder, "status") == b'{"rows":5}\n'


def test_what_is_not_known_is_said_so(network: Network, folder: Path) -> None:
    opened(network, folder, {})
    with pytest.raises(NobodyCollects, match="does not know what 'dance' is"):
        ask(folder, "dance")


@pytest.mark.parametrize("said", [b"", b"\n", b"nonsense\n", b'{"ask": 5}\n', b"x" * 100_000])
def test_nonsense_at_the_door_disturbs_nobody(network: Network, folder: Path, said: bytes) -> None:
    opened(network, folder, {"status": lambda _: 1})
    with socket.socket(socket.AF_UNIX) as guest, module._short(folder) as name:
        guest.connect(name)
        guest.sendall(said)
        guest.shutdown(socket.SHUT_WR)
        assert guest.recv(100) == b""
    assert ask(folder, "status") == b"1\n"


def test_without_a_collector_it_says_how_to_start_one(folder: Path, tmp_path: Path) -> None:
    for where in (folder, tmp_path / "nowhere"):
        with pytest.raises(
            NobodyCollects, match=r"no collector runs on the spool .* start one: gwrms collect"
        ):
            ask(where, "status")


def test_what_a_killed_collector_left_is_no_collector(network: Network, folder: Path) -> None:
    with socket.socket(socket.AF_UNIX) as dead, module._short(folder) as name:
        dead.bind(name)
    with pytest.raises(NobodyCollects, match="no collector runs"):
        ask(folder, "status")
    opened(network, folder, {"status": lambda _: 1})
    assert ask(folder, "status") == b"1\n"


def test_a_collector_that_hangs_is_told_from_one_that_is_not_there(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "ANSWER_S", 0.05)
    with socket.socket(socket.AF_UNIX) as deaf, module._short(folder) as name:
        deaf.bind(name)
        deaf.listen()
        with pytest.raises(NobodyCollects, match="hangs"):
            ask(folder, "status")


def test_the_door_is_gone_when_it_is_closed(folder: Path) -> None:
    with Network() as network:
        opened(network, folder, {})
        assert (folder / NAME).exists()
    assert not (folder / NAME).exists()
