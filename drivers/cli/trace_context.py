"""The devices of a trace that files describe, interface by interface."""

import functools
from collections.abc import Mapping, Sequence
from pathlib import Path

from drivers.bus.settings import CanSettings
from drivers.errors import SettingsError
from drivers.trace.devices import Device
from drivers.trace.robot_file import described, devices

_NODE_IDS = range(1, 128)


class TraceContext:
    """The devices named by `--robot` and `--eds`; `buses` are the interfaces to listen to, if any."""

    def __init__(self, robot: Path | None, words: Sequence[str], buses: Mapping[str, CanSettings]) -> None:
        """Read all of it, so that what is wrong is said first; raises `SettingsError`."""
        self._robot = robot
        self._words = [_parsed(word) for word in words]
        self._buses = buses
        self.on = functools.cache(self._on)
        self.all = [*(() if robot is None else devices(robot, None)), *self.on("")]
        for interface in buses:
            self.all += self.on(interface)

    def names(self, interface: str) -> Mapping[int, str]:
        """Return the names by node id."""
        return {device.node_id: device.name for device in self.on(interface)}

    def _on(self, interface: str) -> Sequence[Device]:
        """Return those of one interface; what `--eds` says counts more than the robot's file."""
        settings = self._buses.get(interface)
        channel = interface or None if settings is None else settings.channel
        found = {} if self._robot is None else {one.node_id: one for one in devices(self._robot, channel)}
        for where, node_id, file in self._words:
            if where in ("", interface):
                before = found.get(node_id)
                name = before.name if before else None
                found[node_id] = described(node_id, name, file, Path.cwd() / "here")
        return list(found.values())


def _parsed(word: str) -> tuple[str, int, str]:
    """Interface (empty: any), node id and file of `5=drive.eds` or `can1/5=drive.eds`."""
    place, equals, file = word.partition("=")
    interface, _, node = place.rpartition("/")
    if not equals or not node.isdecimal() or int(node) not in _NODE_IDS:
        raise SettingsError(f"--eds {word}: say NODE=FILE, as in 5=drive.eds or can1/5=drive.eds")
    return interface, int(node), file
