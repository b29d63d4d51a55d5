"""All drives that stop by themselves when the gateway dies, and why it may not end now."""

import time
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING

from drivers.bus.arming import Arming
from drivers.bus.heartbeat import Heartbeat
from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.quantities import AXIS_OFFSET, STATUSWORD

if TYPE_CHECKING:
    from drivers.joint.drive import JointDrive


class ArmedDrives:
    """One heartbeat a bus, one arming a node; none of them without `heartbeat_ms`.

    `changed(joints, arming)` is called in a driver's thread.
    """

    def __init__(
        self,
        drives: "Mapping[str, JointDrive]",
        heartbeat_ms: int | None,
        changed: Callable[[str, Arming], None],
    ) -> None:
        self._drives = drives if heartbeat_ms is not None else {}
        self._heartbeats: dict[str, Heartbeat] = {}
        self._armings: dict[str, Arming] = {}  # by joint; those of one node share it
        for joints in _by_node(self._drives):
            self._arm(joints, (heartbeat_ms or 0) / 1000, changed)

    def _arm(
        self, joints: "list[JointDrive]", period_s: float, changed: Callable[[str, Arming], None]
    ) -> None:
        node, names = joints[0].node, ", ".join(joint.name for joint in joints)
        bus = node.bus
        if bus.name not in self._heartbeats:
            self._heartbeats[bus.name] = Heartbeat(bus, period_s)
        axes = [joint.settings.axis * AXIS_OFFSET for joint in joints]
        arming = Arming(node, self._heartbeats[bus.name], axes, lambda: changed(names, arming))
        self._armings |= {joint.name: arming for joint in joints}

    @property
    def armed(self) -> frozenset[str]:
        """The joints that stop by themselves."""
        return frozenset(name for name, arming in self._armings.items() if arming.armed)

    @property
    def texts(self) -> dict[str, str]:
        """Each joint: armed, or why not."""
        return {name: arming.text for name, arming in self._armings.items()}

    def start(self) -> None:
        for heartbeat in self._heartbeats.values():
            heartbeat.start()
        for arming in self._each():
            arming.start()

    def feed(self) -> None:
        """Whoever calls this is what the drives rely on."""
        for heartbeat in self._heartbeats.values():
            heartbeat.feed()

    def stop(self) -> list[str]:
        """Disarm the drives, then let the heartbeats end; returns which may still be armed, and why."""
        freeing = [arming.disarm() for arming in self._each()]
        failures = [str(error) for one in freeing if (error := one.exception()) is not None]
        for arming in self._each():
            arming.stop()
        for heartbeat in self._heartbeats.values():
            heartbeat.stop()
        return failures

    def objection(self) -> str | None:
        """Return why the gateway must not end now, in words; `None` if it may."""
        found = [text for name, drive in self._drives.items() if (text := _still_on(name, drive)) is not None]
        if not found:
            return None
        return (
            f"the gateway does not end: {', '.join(found)}. Without its heartbeat the drives would stop by "
            "themselves; stop the robot first (gwrms stop)"
        )

    def _each(self) -> Iterable[Arming]:
        return dict.fromkeys(self._armings.values())


def _by_node(drives: "Mapping[str, JointDrive]") -> "Iterable[list[JointDrive]]":
    nodes: dict[int, list[JointDrive]] = {}
    for drive in drives.values():
        nodes.setdefault(id(drive.node), []).append(drive)
    return nodes.values()


def _still_on(name: str, drive: "JointDrive") -> str | None:
    """Return a drive that is enabled, or that is there and does not say whether it is."""
    now_ns = time.monotonic_ns()
    if not drive.node.ready or drive.node.life.lost(now_ns):
        return None
    index = next(i for i, channel in enumerate(drive.channels) if channel.quantity == STATUSWORD)
    statusword = drive.latest.read(index, now_ns)[0]
    if statusword is None:
        return f"nobody knows whether {name} is enabled"
    enabled = drive_state(int(statusword)) is DriveState.OPERATION_ENABLED
    return f"{name} is enabled" if enabled else None
