"""The robot outside of the gateway: two buses, three joints in two drives, their controller, and the disk.

It lives on when the gateway dies. One process has one world.
"""

import logging
import tempfile
from collections.abc import Callable
from pathlib import Path

from drivers.bus.settings import CanSettings
from tests.explore import patching
from tests.explore.can import Sent, Transport, Wire
from tests.explore.disk import Disk, at
from tests.explore.drive import Axis, Controller, Drive
from tests.explore.node import Device, EdsText
from tests.explore.parameters import PARAMETERS
from tests.explore.runtime import Runtime
from tests.explore.system import System

RECORDS = "/robot/records"
FILE = "/robot/robot.toml"
JOINTS = {"knee": ("left", 0), "hip": ("right", 0), "ankle": ("right", 1)}  # with their drive and axis
STOP_TIMEOUT_S = 2.5

_TOML = """
[robot]
name = "explored"
[gateway]
records = "records"
role = "{role}"
linger_s = 2.0
[can.left]
interface = "virtual"
channel = "left"
[can.right]
interface = "virtual"
channel = "right"
[device.gait]
bus = "left"
node_id = 10
eds = "{folder}/gait.eds"
[stop]
timeout_s = {stop_timeout_s}
fallback = [{fallback}]
[[stop.controller]]
component = "gait"
object = "0x2000:0"
value = 0
{guard}
"""
_JOINT = """
[joint.{name}]
bus = "{bus}"
node_id = {node_id}
axis = {axis}
eds = "{folder}/{bus}.eds"
counts_per_revolution = 4096
gear_ratio = 100
poll_hz = 8
slow_poll_hz = 0
"""
GUARD = """
[guard.rule.limit]
watch = "joint_limit"
on = ["knee"]
max = 1.0
clear_s = 0.3
actions = ["quick_stop", "alarm"]
[guard.rule.takes_back]
watch = "joint_limit"
on = ["hip"]
max = 1.0
clear_s = 0.3
actions = ["revert_trials"]
"""
BLIND = """
[guard.rule.lost]
watch = "joint_limit"
on = ["hip"]
max = 2.0
blind = "act"
clear_s = 0.3
actions = ["quick_stop"]
"""


class World:
    """Everything that is there without any gateway."""

    def __init__(
        self, *, role: str = "observer", guard: str = GUARD, fallback: str = '"disable_voltage"'
    ) -> None:
        self.role = role
        self.runtime = Runtime()
        self.disk = Disk(self.runtime)
        self.system = System(self.runtime, self.disk)
        self.watchers: list[Callable[[Sent], None]] = []
        self.wires = {name: Wire(self.runtime, name, self._tell) for name in ("left", "right")}
        self.left = Drive(self.wires["left"], "left", 1, 1, quick_stop_option=2)
        self.right = Drive(self.wires["right"], "right", 2, 2, quick_stop_option=6)
        self.gait = Controller(self.wires["left"], "gait", 10, (self.left, self.right))
        self.devices: dict[str, Device] = {"left": self.left, "right": self.right, "gait": self.gait}
        drives = {"left": self.left, "right": self.right}
        self.axes: dict[str, Axis] = {name: drives[bus].axes[axis] for name, (bus, axis) in JOINTS.items()}
        self.errors = _Errors()
        self.file = at(self.disk, FILE)
        self.records = at(self.disk, RECORDS)
        self.file.write_bytes(self._toml(guard, fallback).encode())
        self.disk.make_durable()
        patching.install(self.runtime, self.system, self._open_transport)

    def _toml(self, guard: str, fallback: str) -> str:
        folder = Path(tempfile.mkdtemp(prefix="explore-"))
        for name, device in self.devices.items():
            (folder / f"{name}.eds").write_text(EdsText(name, device.entries).text(), encoding="utf-8")
        joints = (
            _JOINT.format(name=name, bus=bus, axis=axis, folder=folder, node_id=self.devices[bus].node_id)
            for name, (bus, axis) in JOINTS.items()
        )
        head = _TOML.format(
            role=self.role, folder=folder, guard=guard, fallback=fallback, stop_timeout_s=STOP_TIMEOUT_S
        )
        parameters = (f'[parameter."{name}"]\n{one.toml}\n' for name, one in PARAMETERS.items())
        return head + "".join(joints) + "".join(parameters)

    def at(self, bus: str, node_id: int) -> Device | None:
        """The device of that node id."""
        found = (one for one in self.devices.values() if (one.wire.name, one.node_id) == (bus, node_id))
        return next(found, None)

    def _tell(self, sent: Sent) -> None:
        for watcher in self.watchers:
            watcher(sent)

    def _open_transport(self, settings: CanSettings) -> Transport:
        return self.wires[str(settings.channel)].connect()


class _Errors(logging.Handler):
    """What the gateway itself calls an error of its own: an exception that nobody expected."""

    def __init__(self) -> None:
        super().__init__(logging.WARNING)
        self.unexpected: list[str] = []
        self.said: list[str] = []
        logger = logging.getLogger("gateway")
        logger.propagate = False
        logger.setLevel(logging.WARNING)
        logger.addHandler(self)
        logging.getLogger("drivers").addHandler(self)

    def emit(self, record: logging.LogRecord) -> None:
        text = record.getMessage()
        self.said.append(text)
        if record.exc_info is not None and record.exc_info[1] is not None:
            error = record.exc_info[1]
            self.unexpected.append(f"{text}: {type(error).__name__}: {error}")
