"""What truly happened, as the devices, the wires and the disk know it: the invariants judge by nothing else."""

import struct
from collections import defaultdict, deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import msgspec

from drivers.joint.cia402 import DriveState, drive_state
from gateway.records.undo import Undo, UndoChange
from tests.explore.can import GATEWAY, Sent
from tests.explore.drive import CONTROLWORD, RUN, STATUSWORD, statusword_of
from tests.explore.gateway_life import Asked, Life
from tests.explore.node import RPDO1, SDO_REQUEST, TPDO1, Address, Device
from tests.explore.world import JOINTS, World

PARAMETERS: dict[str, tuple[str, Address, float]] = {  # name → device, object, counts per unit
    "gait.run": ("gait", (RUN, 0), 1),
    "gait.step_length": ("gait", (0x2001, 0), 1000),
    "gait.cycle_time": ("gait", (0x2002, 0), 1000),
    "knee.max_torque": ("left", (0x6072, 0), 1),
    "ankle.max_torque": ("right", (0x6872, 0), 1),
}
NAMES = {(device, address): name for name, (device, address, _) in PARAMETERS.items()}
LOOK_NS = 5_000_000  # how often the guard is asked how it is


class Known(NamedTuple):
    """A drive's state as it was told to the gateway: of when, and when."""

    sampled_ns: int
    told_ns: int
    state: DriveState | None


class Download(NamedTuple):
    """A value that the gateway sent to an object that is a parameter."""

    stamp_ns: int
    name: str
    value: int
    before: int  # as the device held it then


@dataclass(slots=True)
class Trial:
    """When a write on trial must be over."""

    due_ns: int
    who: str


@dataclass(slots=True)
class Facts:
    """Fed from all sides; `life` is the gateway's present one."""

    world: World
    life: Life
    last_stop_ns: int = 0
    stops: list[Asked] = field(default_factory=list)  # asked for and not yet judged
    held: bool = False
    hold_ended: bool = False  # and nobody has judged it yet
    held_since_ns: int = 0
    control_since_ns: int | None = None  # since when the control module runs
    known: dict[str, deque[Known]] = field(default_factory=lambda: defaultdict(lambda: deque(maxlen=40)))
    run_read: deque[tuple[int, int, int]] = field(default_factory=lambda: deque(maxlen=40))
    quick_stops: dict[str, int] = field(default_factory=dict)  # joint → when its last one was on the bus
    healthy_since: dict[str, int] = field(default_factory=dict)
    enabled_since: dict[str, int] = field(default_factory=dict)
    runs_since: int | None = None
    trips: int = 0
    tripped_since: dict[str, int] = field(default_factory=dict)  # rules that stop
    undo: dict[tuple[int, str], UndoChange] = field(default_factory=dict)
    undo_since: dict[tuple[int, str], int] = field(default_factory=dict)
    dropped: list[tuple[int, UndoChange, tuple[Undo, ...]]] = field(default_factory=list)
    trials: dict[int, Trial] = field(default_factory=dict)
    legit: dict[str, set[int]] = field(default_factory=dict)
    downloads: list[Download] = field(default_factory=list)
    controlwords: list[tuple[int, str, int]] = field(default_factory=list)
    enabling: int = 0  # requests to enable that are under way
    last_change_ns: int = 0  # when the gateway last did something that lasts
    disk_seen: int = -1
    undo_bytes: bytes = b""
    looked_ns: int = 0

    def __post_init__(self) -> None:
        self.world.watchers.append(self.on_frame)
        for device in self.world.devices.values():
            device.told = self.on_read
        self.legit = {name: {self.value(name)} for name in PARAMETERS}

    @property
    def now_ns(self) -> int:
        return self.world.runtime.now_ns

    # Questions

    def value(self, name: str) -> int:
        device, address, _ = PARAMETERS[name]
        return self.world.devices[device].get(*address)

    def is_ours(self, name: str) -> bool:
        """Whether the gateway wrote what the device holds."""
        device, address, _ = PARAMETERS[name]
        written = self.world.devices[device].writers.get(address)
        return written is not None and written.who == GATEWAY

    def healthy_for(self, device: str, seconds: float) -> bool:
        since = self.healthy_since.get(device)
        return since is not None and self.now_ns - since >= seconds * 1e9

    def newest(self, joint: str, before_ns: int) -> Known | None:
        return next((one for one in reversed(self.known[joint]) if one.told_ns <= before_ns), None)

    # What is told

    def on_frame(self, sent: Sent) -> None:
        if sent.sender == GATEWAY:
            self._on_ours(sent)
        elif TPDO1 < sent.can_id < TPDO1 + 0x80 and self._hears(sent.bus):
            joint = next(name for name, (bus, axis) in JOINTS.items() if bus == sent.bus and axis == 0)
            self.known[joint].append(Known(self.now_ns, self.now_ns, drive_state(statusword_of(sent))))

    def on_read(self, device: Device, address: Address, sampled_ns: int, data: bytes) -> None:
        number = int.from_bytes(data, "little")
        for joint, (bus, axis) in JOINTS.items():
            if device.name == bus and address == (STATUSWORD + 0x800 * axis, 0):
                self.known[joint].append(Known(sampled_ns, self.now_ns, drive_state(number)))
        if device is self.world.gait and address == (RUN, 0):
            self.run_read.append((sampled_ns, self.now_ns, number))

    def on_asked(self, asked: Asked) -> None:
        if asked.method == "robot.stop":
            self.last_stop_ns = self.now_ns
            self.stops.append(asked)
        self.enabling += asked.method == "robot.enable"
        self.last_change_ns = self.now_ns

    def on_answer(self, asked: Asked) -> None:
        self.last_change_ns = self.now_ns
        self.enabling -= asked.method == "robot.enable"
        if asked.method == "parameter.write" and asked.result is not None:
            written = asked.result
            if written.trial_s is not None:
                self.trials[written.write] = Trial(self.now_ns + round(written.trial_s * 1e9), asked.who)
                if asked.who not in self.life.people:
                    self.on_left(asked.who)
            else:
                for name, value in asked.params["changes"].items():
                    self.legit[name] = {round(value * PARAMETERS[name][2])}
        if asked.method == "parameter.confirm" and asked.result is not None:
            for name, value in asked.result.values.items():
                self.legit[name] = {round(value * PARAMETERS[name][2])}

    def on_left(self, who: str) -> None:
        """What somebody has on trial ends now."""
        for trial in self.trials.values():
            if trial.who == who:
                trial.due_ns = min(trial.due_ns, self.now_ns)

    def on_others(self, *names: str) -> None:
        """Somebody else, or the loss of power, has changed these in the device."""
        for name in names:
            self.legit[name] = {self.value(name)}

    def on_new_life(self, life: Life) -> None:
        """Of what was not answered nobody knows what became of it."""
        for asked in self.life.asked:
            if asked.method == "parameter.write" and asked.answered_ns is None:
                for name, value in asked.params["changes"].items():
                    self.legit[name].add(round(value * PARAMETERS[name][2]))
        for trial in self.trials.values():
            trial.due_ns = min(trial.due_ns, self.now_ns)
        self.life, self.held, self.control_since_ns, self.enabling = life, False, None, 0
        self.trips, self.tripped_since, self.stops = 0, {}, []

    def look(self) -> None:
        """Between two tasks."""
        control = self.life.module("control")
        if (control is None) != (self.control_since_ns is None):
            self.control_since_ns = None if control is None else self.now_ns
        held = control is not None and control.stop_held
        if held and not self.held:
            self.held_since_ns = self.now_ns
        self.hold_ended |= self.held and not held and control is not None
        self.held = held
        if self.world.disk.changes != self.disk_seen:
            self.disk_seen = self.world.disk.changes
            self._look_at_undo()
        if self.now_ns - self.looked_ns >= LOOK_NS:
            self.looked_ns = self.now_ns
            self._look_at_guard()
            self.look_at_devices()

    # How it is found

    def _hears(self, bus: str) -> bool:
        wire = self.world.wires[bus]
        return wire.transport is not None and not wire.gone

    def _on_ours(self, sent: Sent) -> None:
        device = next(
            (
                one
                for one in self.world.devices.values()
                if one.wire.name == sent.bus and one.node_id == sent.can_id & 0x7F
            ),
            None,
        )
        if device is None:
            return
        if sent.can_id & 0x780 == RPDO1:
            self._on_controlword(device, 0, int.from_bytes(sent.data[:2], "little"))
        if sent.can_id & 0x780 != SDO_REQUEST or sent.data[0] >> 5 != 1:
            return
        self.last_change_ns = self.now_ns
        command, index, subindex = struct.unpack_from("<BHB", sent.data)
        value = int.from_bytes(sent.data[4 : 8 - (command >> 2 & 3)], "little")
        if index in range(CONTROLWORD, 0xA000, 0x800):
            self._on_controlword(device, (index - CONTROLWORD) // 0x800, value)
        name = NAMES.get((device.name, (index, subindex)))
        if name is not None:
            self.downloads.append(Download(self.now_ns, name, value, self.value(name)))

    def _on_controlword(self, device: Device, axis: int, value: int) -> None:
        joint = next(name for name, at in JOINTS.items() if at == (device.name, axis))
        self.controlwords.append((self.now_ns, joint, value))
        if value & 0x86 == 0x02:
            self.quick_stops[joint] = self.now_ns

    def _look_at_undo(self) -> None:
        file = self.world.disk.files.get(f"{self.world.records}/undo.json")
        data = b"" if file is None else bytes(file.data)
        if data == self.undo_bytes:
            return
        self.undo_bytes = data
        undos: list[Undo] = msgspec.json.decode(data, type=list[Undo]) if data else []
        now = {(one.write, change.parameter): change for one in undos for change in one.changes}
        for (write, _name), change in self.undo.items():
            if (write, change.parameter) not in now:
                self.dropped.append((write, change, tuple(undos)))
        self.undo_since = {key: self.undo_since.get(key, self.now_ns) for key in now}
        self.undo = now
        self.last_change_ns = self.now_ns

    def _look_at_guard(self) -> None:
        guard: Any = self.life.module("guard")
        if guard is None:
            return
        rules = [one for one in guard.info().rules if "quick_stop" in one.actions]
        trips = sum(one.trips for one in rules)
        if trips > self.trips:
            since = [one.since_ns or 0 for one in rules if one.state == "tripped"]
            self.last_stop_ns = max(self.last_stop_ns, *since, 0)
        self.trips = trips
        self.tripped_since = {
            one.name: self.tripped_since.get(one.name, self.now_ns) for one in rules if one.state == "tripped"
        }

    def look_at_devices(self) -> None:
        now_ns = self.now_ns
        for name, device in self.world.devices.items():
            well = device.answers and device.wire.transport is not None
            if well != (name in self.healthy_since):
                self.healthy_since = {one: at for one, at in self.healthy_since.items() if one != name}
                if well:
                    self.healthy_since[name] = now_ns
        for joint, axis in self.world.axes.items():
            if axis.enabled:
                self.enabled_since.setdefault(joint, now_ns)
            else:
                self.enabled_since.pop(joint, None)
        self.runs_since = (self.runs_since or now_ns) if self.world.gait.runs else None
