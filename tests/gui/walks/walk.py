"""A newcomer's bench: a simulated robot, a network to it that can be cut, and the window on it."""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from server_gui.processes.sim_control import SimControl
from server_gui.processes.simulated import simulated_robot
from tests.fake_robot import FakeRobot
from tests.gui.test_stop_under_x import x_server
from tests.gui.walks.hand import Hand, opened
from tests.slow_network import SlowNetwork

STORE = """[store]
url = "{store}"
[recorder]
spool = "{spool}"
batch_s = 5.0
"""


@dataclass(frozen=True)
class Screen:
    """What a newcomer sits before."""

    width: int
    height: int
    scale: int = 100
    look: str = "dark"

    @property
    def name(self) -> str:
        return f"{self.width}x{self.height}-{self.scale}-{self.look}"


@dataclass
class Bench:
    """A robot, named *walker* in the window, and whoever works at it."""

    hand: Hand
    robot: SimControl
    folder: Path
    network: SlowNetwork
    port: int  # of the gateway itself
    second: FakeRobot  # which the window is not told of at first

    def cut(self) -> None:
        """The network to the robot is gone."""
        self.network.close()

    def mend(self) -> None:
        """It is back, at the same address."""
        self.network = SlowNetwork(self.port, 0.0, self.network.port)
        self.network.__enter__()


@contextlib.contextmanager
def walker(folder: Path) -> Iterator[tuple[SimControl, int]]:
    """A simulated robot that walks, and the port of its gateway."""
    home = folder / "robot"
    home.mkdir(parents=True)
    with simulated_robot(home, "walk", lambda: None) as (address, _):
        yield SimControl(home), address.port


@contextlib.contextmanager
def bench(screen: Screen, folder: Path, pictures: Path) -> Iterator[Bench]:
    """All of it, ended together."""
    with walker(folder) as (robot, port), x_server(f"{screen.width}x{screen.height}x24") as display:
        network = SlowNetwork(port, 0.0)
        config = folder / "server.toml"
        store = (folder / "store").as_uri()
        config.write_text(STORE.format(store=store, spool=folder / "spool"), encoding="utf-8")
        arguments = (
            *("gui", "--config", str(config), "--robot", f"walker=127.0.0.1:{network.port}"),
            *("--look", screen.look, "--scale", str(screen.scale), "--operator", "Ada"),
        )
        with FakeRobot() as second, network, opened(display, folder / "home", pictures, arguments) as hand:
            made = Bench(hand, robot, folder, network, port, second)
            try:
                yield made
            finally:
                made.network.close()
