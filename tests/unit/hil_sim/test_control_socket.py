"""The live door: requests and answers, clients that misbehave, and the command that uses it."""

import json
import socket
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gateway.main import main
from hil_sim.control_socket import LINE_BYTES, ask
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import Exoskeleton, Scenario
from hil_sim.faults.injector import Faults
from hil_sim.faults.registry import FAULTS
from hil_sim.operator import Operator
from hil_sim.robot import SimulatedRobot
from tests.support.examples import examples
from tests.support.waiting import WAIT_S


@pytest.fixture(scope="module")
def operator(tmp_path_factory: pytest.TempPathFactory) -> Operator:
    """Of a robot that nothing runs."""
    robot = Exoskeleton(Scenario.STAND)
    robot.power_on()
    return Operator(robot, Faults(robot, tmp_path_factory.mktemp("faults")))


@pytest.fixture(scope="module")
def running(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SimulatedRobot]:
    folder = tmp_path_factory.mktemp("a folder whose name is far too long for a socket" * 2)
    with SimulatedRobot(folder, virtual_channel=str(folder)) as robot:
        yield robot


@pytest.fixture
def folder(running: SimulatedRobot) -> Path:
    ask(running.folder.path, {"clear": "all"})
    return running.folder.path


def active(answer: dict[str, object]) -> object:
    """What a list says is on."""
    return answer["active"]


class Raw:
    """A client of its own making."""

    def __init__(self, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(folder)  # the address is short
        self.socket = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.settimeout(WAIT_S)
        self.socket.connect("control")
        self._lines = self.socket.makefile("rb")

    def say(self, data: bytes) -> None:
        self.socket.sendall(data)

    def answer(self) -> dict[str, object]:
        found: dict[str, object] = json.loads(self._lines.readline())
        return found

    def closed(self) -> bool:
        return self._lines.readline() == b""

    def close(self) -> None:
        self._lines.close()
        self.socket.close()


@pytest.fixture
def connect(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[[], Raw]]:
    clients: list[Raw] = []

    def make() -> Raw:
        clients.append(Raw(folder, monkeypatch))
        return clients[-1]

    yield make
    for client in clients:
        client.close()


def test_a_fault_is_begun_listed_and_cleared(folder: Path) -> None:
    begun = ask(folder, {"fault": "node_lost", "on": "left_knee", "for_s": 100})["begun"]
    assert begun["until_s"] == pytest.approx(begun["since_s"] + 100)
    assert active(ask(folder, {"list": True})) == [begun]
    assert ask(folder, {"clear": "node_lost", "on": "left_knee"}) == {"cleared": [begun]}
    assert active(ask(folder, {"list": True})) == []


def test_every_fault_is_listed_with_its_keys_and_where_it_is_on(folder: Path) -> None:
    ask(folder, {"fault": "bus_load", "params": {"percent": 20}})
    faults = ask(folder, {"list": True})["faults"]
    assert list(faults) == list(FAULTS)
    assert (faults["bus_load"]["on"], faults["bus_load"]["active"]) == (["bus"], ["bus"])
    percent = faults["bus_load"]["params"]["percent"]
    assert {"default", "min", "max", "unit", "what"} == set(percent)
    assert (faults["node_lost"]["active"], faults["node_lost"]["momentary"]) == ([], False)
    assert faults["reboot"]["looks"] == FAULTS["reboot"].looks


def test_params_reach_the_fault(folder: Path) -> None:
    begun = ask(folder, {"fault": "bus_load", "params": {"percent": 20, "cob_id": "0x7F0"}})["begun"]
    assert begun["values"] == {"percent": 20, "cob_id": 0x7F0}


def test_the_activity_is_the_gait_controllers(folder: Path, running: SimulatedRobot) -> None:
    assert ask(folder, {"activity": "sit"}) == {"activity": "sit"}
    assert running.exoskeleton.controller.dictionary[0x2005, 0].value == 2


def test_the_controller_is_stopped_and_started(folder: Path) -> None:
    assert ask(folder, {"controller": "stop"}) == {"controller": "held"}
    assert ask(folder, {"controller": "start"}) == {"controller": "starting"}


@pytest.mark.parametrize(
    ("request_", "words"),
    [
        ({"fault": "nod_lost"}, "did you mean 'node_lost'"),
        ({"fault": ["node_lost"]}, "there is no fault"),
        ({"fault": "reboot", "on": "gait", "x": 1}, "'x' does not belong to 'fault'"),
        ({"fault": "bus_load", "params": [1]}, "no table of parameters"),
        ({"clear": "nod_lost"}, "did you mean 'node_lost'"),
        ({"activity": "swim"}, "there is no activity 'swim': stand, walk, sit"),
        ({"activity": 1}, "there is no activity 1"),
        ({"controller": "dance"}, "is no command: start, stop"),
        ({"controller": ["start"]}, "is no command: start, stop"),
        ({"list": True, "clear": "all"}, "say one of fault, clear, activity"),
        ({}, "not nothing"),
    ],
)
def test_what_cannot_be_is_refused_in_words(folder: Path, request_: dict[str, object], words: str) -> None:
    with pytest.raises(SimulatorError, match=words):
        ask(folder, request_)
    assert active(ask(folder, {"list": True})) == []


_WORDS = st.sampled_from(
    ["node_lost", "bus_load", "left_knee", "all", "sit", "start", "percent", "fault", ""]
)
_ANYTHING = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | _WORDS,
    lambda some: st.lists(some, max_size=3) | st.dictionaries(_WORDS, some, max_size=3),
    max_leaves=6,
)
_KEYS = st.sampled_from(["fault", "on", "for_s", "params", "clear", "activity", "controller", "list"])


@settings(max_examples=examples(120))
@given(st.dictionaries(_KEYS, _ANYTHING, max_size=4) | _ANYTHING)
def test_whatever_is_asked_is_done_or_refused(operator: Operator, request_: object) -> None:
    with suppress(SimulatorError):
        json.dumps(operator.obey(request_))
    operator.obey({"clear": "all"})


def test_requests_in_pieces_and_several_at_once_are_answered_in_order(connect: Callable[[], Raw]) -> None:
    client = connect()
    client.say(b'{"li')
    client.say(b'st": true}\n{"nothing": 1}\n[1]\n')
    assert active(client.answer()) == []
    assert "say one of" in str(client.answer()["error"])
    assert "a request is an object" in str(client.answer()["error"])


@pytest.mark.parametrize("rubbish", [b"\n", b"\xff\xfe\n", b"{\n", b"[" * 50_000 + b"\n", b"nul\0\n"])
def test_what_is_no_json_is_said_and_the_next_line_counts(connect: Callable[[], Raw], rubbish: bytes) -> None:
    client = connect()
    client.say(rubbish)
    assert "no line of JSON" in str(client.answer()["error"])
    client.say(b'{"list": true}\n')
    assert active(client.answer()) == []


def test_a_line_without_end_is_cut_off_and_the_others_are_served(connect: Callable[[], Raw]) -> None:
    endless, other = connect(), connect()
    endless.say(b"x" * (LINE_BYTES + 1))
    assert endless.closed()
    other.say(b'{"list": true}\n')
    assert active(other.answer()) == []


def test_a_client_that_fetches_no_answers_is_cut_off_and_the_others_are_served(
    connect: Callable[[], Raw],
) -> None:
    deaf, other = connect(), connect()
    with pytest.raises(ConnectionError):
        deaf.say(b'{"fault": "nod_lost"}\n' * 100_000)
    other.say(b'{"list": true}\n')
    assert active(other.answer()) == []


def test_clients_that_vanish_do_no_harm(folder: Path, connect: Callable[[], Raw]) -> None:
    for _ in range(20):
        connect().close()
    assert active(ask(folder, {"list": True})) == []


def test_nobody_there_is_said_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(
        SimulatorError, match=r"no simulator answers in .*: none runs there; .*gwrms sim --dir"
    ):
        ask(tmp_path, {"list": True})
    (file := tmp_path / "robot.toml").touch()
    with pytest.raises(SimulatorError, match="that is no folder; --dir is the folder of gwrms sim"):
        ask(file, {"list": True})
    with pytest.raises(SimulatorError, match="there is no such folder; start one") as told:
        ask(tmp_path / "nowhere", {"list": True})
    assert "Errno" not in str(told.value)


def test_a_simulator_that_was_killed_is_not_there(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as left_behind:
        left_behind.bind(str(tmp_path / "control"))
    with pytest.raises(SimulatorError, match="none runs there; start one"):
        ask(tmp_path, {"list": True})


def test_the_socket_is_gone_with_the_simulator(tmp_path: Path) -> None:
    with SimulatedRobot(tmp_path, virtual_channel=str(tmp_path)):
        assert (tmp_path / "control").is_socket()
    assert not (tmp_path / "control").exists()


# -- gwrms sim-fault -----------------------------------------------------------------------------------------


def sim_fault(*arguments: str | Path) -> int:
    return main(["sim-fault", *map(str, arguments)])


def test_the_command_begins_shows_and_clears(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sim_fault("--dir", folder, "node_lost", "--on", "left_hip", "--for", "60") == 0
    assert sim_fault("--dir", folder, "bus_load", "percent=30", "cob_id=0x7F0") == 0
    assert sim_fault("--dir", folder, "--active") == 0
    assert sim_fault("--dir", folder, "--clear", "all") == 0
    assert sim_fault("--dir", folder, "--active") == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("begun: node_lost on left_hip from ")
    assert lines[1].endswith("until it is cleared, percent 30 %, cob_id 0x7F0")
    assert [line.split()[0] for line in lines[2:4]] == ["node_lost", "bus_load"]
    assert lines[4:6] == ["cleared: node_lost on left_hip", lines[5]]
    assert lines[5].startswith("cleared: bus_load on ")
    assert lines[6] == "nothing is on"


def test_the_command_lists_every_fault_without_a_simulator(capsys: pytest.CaptureFixture[str]) -> None:
    assert sim_fault("--list") == 0
    text = capsys.readouterr().out
    for name, fault in FAULTS.items():
        assert f"\n{name}" in text
        assert fault.looks in text
    assert "-- on left_insole, right_insole or trunk\n" in text


def test_the_command_says_what_was_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert sim_fault("--dir", folder, "nod_lost") == 1
    assert "did you mean 'node_lost'?" in capsys.readouterr().err


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["node_lost"],
        ["--dir", "x"],
        ["--dir", "x", "bus_load", "percent"],
        ["--dir", "x", "bus_load", "--for", "long"],
        ["--dir", "x", "--list", "--active"],
    ],
)
def test_wrong_usage_is_2(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert sim_fault(*arguments) == 2
    assert "usage: gwrms sim-fault" in capsys.readouterr().err
