"""Each fault of a joint, a bus or a sensor that is no silence: seen in `robot.describe`, and gone after."""

import json
import socket
from collections.abc import Iterator
from typing import Any

import pytest

from hil_sim.cli.fault import main as sim_fault
from tests.scenario.processes import Bench, gwrms
from tests.support.waiting import until

# By fault: what it is asked for with, where it is to be seen, and the words.
Fault = tuple[list[str], str, str]
# There at once, each at a device of its own.
DEVICES: dict[str, Fault] = {
    # First, as long as it walks: the gait controller stops when it misses heartbeats.
    "encoder_stuck": (["--on", "left_ankle"], "left_ankle", "stays the same to the count"),
    "sdo_silent": (["--on", "left_knee"], "left_knee", "answers no SDO"),
    "sdo_late": (["--on", "right_knee"], "right_knee", "answers SDO after 8"),
    "emcy": (["--on", "left_hip", "code=0x2351"], "left_hip", "it reports 0x2351 load level warning"),
    "sensor_dropout": (["--on", "left_insole"], "left_insole", "% of its frames are missing"),
    "insole_saturated": (["--on", "right_insole"], "right_insole", "cell at the end of its range"),
}
# One after another: each hides the others.
BUS: dict[str, Fault] = {
    "error_frames": ([], "main", "error frames in the last"),
    "bus_load": ([], "main", "% of its time is taken: send fewer PDOs"),
    "frame_loss": (["percent=20"], "right_hip", "% of its PDOs are missing"),
    "gateway_bus_off": ([], "main", "the CAN controller is bus off"),
}


@pytest.fixture(scope="module")
def watched(walking: Bench) -> Iterator[Bench]:
    """Somebody has everything open: only then it is judged."""
    with socket.create_connection(("127.0.0.1", walking.port)) as link:
        link.sendall(b'{"jsonrpc":"2.0","id":1,"method":"robot.describe"}\n')
        assert link.recv(1)
        yield walking


def told(bench: Bench, where: str) -> str:
    """All that is said of a bus, its nodes, or a component."""
    described = bench.ask("robot.describe")
    texts = [str(one["problem"]) for one in described["components"] if one["name"] == where]
    for bus in described["buses"]:
        parts = [bus] * (bus["name"] == where)
        parts += [node for node in bus["nodes"] if where in node["components"]]
        texts += [f"{one['words']}: {one['check']}" for part in parts for one in part["findings"]]
    return "; ".join(texts)


@pytest.mark.parametrize(
    "faults", [DEVICES, *({name: fault} for name, fault in BUS.items())], ids=["devices", *BUS]
)
def test_each_fault_is_named_with_what_to_check_and_gone_after(
    watched: Bench, faults: dict[str, Fault]
) -> None:
    folder = str(watched.folder)

    def are(there: bool) -> None:
        for _, where, words in faults.values():
            until(lambda: (words in told(watched, where)) is there, lambda: told(watched, where))  # noqa: B023

    are(False)
    for name, (arguments, _, _) in faults.items():
        assert sim_fault(["--dir", folder, name, *arguments]) == 0
    are(True)
    for name in faults:
        assert sim_fault(["--dir", folder, "--clear", name]) == 0
    are(False)


def test_the_command_shows_buses_nodes_and_findings(watched: Bench) -> None:
    folder = str(watched.folder)
    assert sim_fault(["--dir", folder, "error_frames"]) == 0
    until(lambda: "error frames" in told(watched, "main"))
    shown = gwrms("describe", "--robot", watched.address).stdout
    described: dict[str, Any] = json.loads(gwrms("describe", "--robot", watched.address, "--json").stdout)
    assert sim_fault(["--dir", folder, "--clear", "error_frames"]) == 0
    (row,) = (line for line in shown.splitlines() if line.startswith("main  error active"))
    assert "%" in row
    (row,) = (line for line in shown.splitlines() if "error frames in the last" in line)
    assert "check termination, wiring and bitrate" in row
    assert "main 2   left_knee" in shown
    (bus,) = described["buses"]
    assert bus["error_frames"] > 0
    assert bus["findings"][0]["since_ns"] < described["clock"]["monotonic_ns"]
    assert {node["node_id"] for node in bus["nodes"]} == {1, 2, 3, 4, 5, 6, 16}
