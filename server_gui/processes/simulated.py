"""A simulated robot on this computer: simulator and gateway as processes that end together."""

import contextlib
import json
import re
from collections.abc import Callable, Iterator
from enum import Enum
from pathlib import Path
from typing import Final

from gateway.client import Address
from server_gui.processes.children import Child

START_S: Final = 60.0  # for a simulator or a gateway to become ready, on a slow machine


class RobotPart(Enum):
    """Part of a simulated robot, in the order of their start."""

    SIMULATOR = "simulator"
    GATEWAY = "gateway"


@contextlib.contextmanager
def simulated_robot(
    folder: Path,
    scenario: str,
    give_up: Callable[[], None],
    ready: Callable[[RobotPart], None] = lambda _: None,
) -> Iterator[tuple[Address, Callable[[], None]]]:
    """Provide its gateway's address, and a check that all is well; `give_up` may raise while it starts.

    `ready` hears of each part as soon as it is.

    Raises:
        ChildFailed: simulator or gateway ended, or never became ready.

    """
    with Child(RobotPart.SIMULATOR.value, ["sim", "--dir", str(folder), "--scenario", scenario]) as simulator:
        config = simulator.wait_ready(_config_in, START_S, give_up)
        ready(RobotPart.SIMULATOR)

        def check_simulator() -> None:
            give_up()
            simulator.check()

        with Child(RobotPart.GATEWAY.value, ["gateway", config, "--port", "0"]) as gateway:
            address = gateway.wait_ready(address_in, START_S, check_simulator)
            ready(RobotPart.GATEWAY)

            def check() -> None:
                check_simulator()
                gateway.check()

            yield address, check


def _config_in(line: str) -> str | None:
    """Parse the simulator's first line, `{"ready": true, "config": …}`."""
    try:
        said = json.loads(line)
    except ValueError:
        return None
    return str(said["config"]) if isinstance(said, dict) and said.get("ready") else None


def address_in(line: str) -> Address | None:
    """Parse the gateway's first line, `listening on HOST:PORT`."""
    said = re.fullmatch(r"listening on (\S+)", line.strip())
    return Address.parse(said[1]) if said else None
