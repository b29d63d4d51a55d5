"""A newcomer's bench: a simulated robot, a network to it that can be cut, and the window on it."""

import contextlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

from server_gui.processes.sim_control import SimControl
from server_gui.processes.simulated import simulated_robot
from tests.gui.test_stop_under_x import x_server
from tests.gui.walks.hand import Hand, opened
from tests.slow_network import SlowNetwork

STORE = """[store]
url = "{store}"
[recorder]
spool = "{spool}"
batch_s = 5.0
"""
KEPT = "[General]\nlook={look}\nscale={scale}\n"


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
    ends: contextlib.ExitStack = field(default_factory=contextlib.ExitStack)  # what moments have begun

    @property
    def store(self) -> Path:
        return self.folder / "store"

    @property
    def spool(self) -> Path:
        return self.folder / "spool"

    def cut(self) -> None:
        """The network to the robot is gone."""
        self.network.close()

    def mend(self) -> None:
        """It is back, at the same address."""
        self.network = SlowNetwork(self.port, 0.0, self.network.port)
        self.network.__enter__()

    def another(self) -> str:
        """One more robot, which the window is not told of: where it listens."""
        _, port = self.ends.enter_context(walker(self.folder / "another"))
        return f"127.0.0.1:{port}"


Made = Callable[[Screen, Path, Path], AbstractContextManager[Bench]]


@contextlib.contextmanager
def walker(home: Path) -> Iterator[tuple[SimControl, int]]:
    """A simulated robot that walks, and the port of its gateway."""
    home.mkdir(parents=True)
    with simulated_robot(home, "walk", lambda: None) as (address, _):
        yield SimControl(home), address.port


@contextlib.contextmanager
def bench(screen: Screen, folder: Path, pictures: Path) -> Iterator[Bench]:
    """All of it, ended together."""
    with walker(folder / "robot") as (robot, port), x_server(f"{screen.width}x{screen.height}x24") as display:
        network = SlowNetwork(port, 0.0)
        config = folder / "server.toml"
        store = (folder / "store").as_uri()
        config.write_text(STORE.format(store=store, spool=folder / "spool"), encoding="utf-8")
        arguments = (
            *("gui", "--config", str(config), "--robot", f"walker=127.0.0.1:{network.port}"),
            *("--look", screen.look, "--scale", str(screen.scale), "--operator", "Ada"),
        )
        with network, opened(display, folder / "home", pictures, arguments) as hand:
            made = Bench(hand, robot, folder, network, port)
            try:
                with made.ends:
                    yield made
            finally:
                made.network.close()


@contextlib.contextmanager
def demo(screen: Screen, folder: Path, pictures: Path) -> Iterator[Bench]:
    """`gwrms demo`, which starts a robot of its own; nothing is between that and the window."""
    kept, robot = folder / "home" / "config" / "gwrms", folder / "robot"
    for made in (kept, robot):
        made.mkdir(parents=True)
    (kept / "gui.conf").write_text(KEPT.format(look=screen.look, scale=screen.scale), encoding="utf-8")
    with (
        x_server(f"{screen.width}x{screen.height}x24") as display,
        opened(display, folder / "home", pictures, ("demo", "--dir", str(robot))) as hand,
        SlowNetwork(0, 0.0) as nothing,
    ):
        yield Bench(hand, SimControl(robot), robot, nothing, 0)
