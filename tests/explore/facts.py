"""What truly happened, as devices, wires and disk know it: the invariants judge by nothing else."""

import struct
from collections import Counter, defaultdict, deque
from dataclasses import dataclass, field
from functools import partial
from typing import Any, NamedTuple

import msgspec

from drivers.joint.cia402 import DriveState, drive_state
from gateway.records.undo import Undo, UndoChange
from tests.explore.can import GATEWAY, Sent
from tests.explore.drive import CONTROLWORD, MAX_TORQUE, RUN, STATUSWORD, statusword_of
from tests.explore.gateway_life import Asked, Life
from tests.explore.node import RPDO1, SDO_REQUEST, TPDO1, Address, Device
from tests.explore.parameters import NAMES, PARAMETERS, counts
from tests.explore.world import JOINTS, World

LOOK_NS = 5_000_000  # how often the guard and the devices are asked how they are
SEEN_NS = 2_000_000_000  # how long before a write a value may have been read, answers late or not
LOST_S = 5.0  # how long the gateway may go on with what somebody asked for who has left
KNOWN = 1000  # statuswords of a drive that are remembered


class Known(NamedTuple):
    """A drive's state as it was told to the gateway: of when, and when."""

    sampled_ns: int
    told_ns: int
    state: DriveState | None


class Commanded(NamedTuple):
    """A controlword that the gateway sent, and the state in which it met the drive, and since when."""

    joint: str
    controlword: int
    state: DriveState
    since_ns: int


class Download(NamedTuple):
    """A value that the gateway sent to an object that is a parameter, and what the device held then.

    `seen`: the gateway can have known what it held.
    """

    stamp_ns: int
    name: str
    value: int
    before: int
    seen: bool


@dataclass(slots=True)
class Trial:
    """When a write on trial must be over."""

    due_ns: int
    who: str


def _deques() -> dict[str, deque[Known]]:
    return defaultdict(lambda: deque(maxlen=KNOWN))


@dataclass(slots=True)
class Facts:
    """Fed from all sides; `life` is the gateway's present one."""

    world: World
    life: Life
    # Stops and holds
    stops_ns: list[int] = field(default_factory=list)  # when they were asked for, or a rule tripped
    stops: list[Asked] = field(default_factory=list)  # that nobody has judged yet
    held: bool = False
    held_since_ns: int = 0
    hold_ended: bool = False  # and nobody has judged it yet
    must_hold: bool = False  # a stop was answered as held, also beyond this gateway
    reset_ns: int = 0  # when the last reset was answered
    tripped_since: dict[str, int] = field(default_factory=dict)  # rules that stop
    trips: int = 0
    # What the gateway was told, and what it sent
    known: dict[str, deque[Known]] = field(default_factory=_deques)
    run_read: deque[tuple[int, int]] = field(default_factory=lambda: deque(maxlen=KNOWN))
    stopped_at: dict[str, int] = field(default_factory=dict)  # joint → when it was last told to stop
    controlwords: list[Commanded] = field(default_factory=list)  # that nobody has judged yet
    downloads: list[Download] = field(default_factory=list)  # that nobody has judged yet
    # How the devices are
    healthy_since: dict[str, int] = field(default_factory=dict)  # since when it answers in time
    whole_since: dict[str, int] = field(default_factory=dict)  # and says by itself what it should
    enabled_since: dict[str, int] = field(default_factory=dict)
    rests_since: dict[str, int] = field(default_factory=dict)
    runs_since: int | None = None  # the controller
    # Writes
    undo: dict[tuple[int, str], UndoChange] = field(default_factory=dict)  # by write and parameter
    undo_since: dict[tuple[int, str], int] = field(default_factory=dict)
    undo_bytes: bytes = b""
    dropped: list[tuple[int, UndoChange, tuple[Undo, ...]]] = field(default_factory=list)
    trials: dict[int, Trial] = field(default_factory=dict)
    legit: dict[str, set[int]] = field(default_factory=dict)  # what each parameter may hold for good
    # The gateway
    control_since_ns: int | None = None  # since when the control module runs
    open: Counter[str] = field(default_factory=Counter)  # requests that are under way, by their methods
    last_change_ns: int = 0  # when something last happened that lasts
    looked_ns: int = 0
    looked_at_all_ns: int = 0
    _disk_seen: int = -1

    def __post_init__(self) -> None:
        self.world.watchers.append(self.on_frame)
        for device in self.world.devices.values():
            device.told = self.on_read
        self.legit = {name: {self.value(name)} for name in PARAMETERS}

    # Questions

    @property
    def now_ns(self) -> int:
        return self.world.runtime.now_ns

    @property
    def waiting(self) -> list[Asked]:
        """Requests whose answers are waited for."""
        if not self.open.total():
            return []
        return [one for one in self.life.asked if one.answered_ns is None and not one.lost]

    def value(self, name: str) -> int:
        parameter = PARAMETERS[name]
        return self.world.devices[parameter.device].get(*parameter.address)

    def writer(self, name: str) -> tuple[str, int]:
        """Who wrote what the device holds, and when."""
        parameter = PARAMETERS[name]
        return self.world.devices[parameter.device].writers.get(parameter.address, ("", 0))

    def is_ours(self, name: str) -> bool:
        """Whether the gateway wrote what the device holds."""
        return self.writer(name)[0] == GATEWAY

    def healthy_for(self, device: str, seconds: float) -> bool:
        since = self.healthy_since.get(device)
        return since is not None and self.now_ns - since >= seconds * 1e9

    def newest(self, joint: str, before_ns: int) -> Known | None:
        return next((one for one in reversed(self.known[joint]) if one.told_ns <= before_ns), None)

    def last_stop_ns(self, before_ns: int) -> int:
        """When the last one was asked for, or a rule tripped, that came before."""
        return max((at_ns for at_ns in self.stops_ns if at_ns <= before_ns), default=0)

    # What is told

    def on_frame(self, sent: Sent) -> None:
        if sent.sender == GATEWAY:
            self._on_ours(sent)
        elif TPDO1 < sent.can_id < TPDO1 + 0x80 and self.world.wires[sent.bus].hears:
            joint = next(name for name, at in JOINTS.items() if at == (sent.bus, 0))
            self.known[joint].append(Known(self.now_ns, self.now_ns, drive_state(statusword_of(sent))))

    def on_read(self, device: Device, address: Address, sampled_ns: int, data: bytes) -> None:
        number = int.from_bytes(data, "little")
        for joint, (bus, axis) in JOINTS.items():
            if device.name == bus and address == (STATUSWORD + 0x800 * axis, 0):
                self.known[joint].append(Known(sampled_ns, self.now_ns, drive_state(number)))
        if device is self.world.gait and address == (RUN, 0):
            self.run_read.append((sampled_ns, number))

    def on_asked(self, asked: Asked) -> None:
        if asked.method == "robot.stop":
            self.on_stop(asked)
        self.open[asked.method] += 1
        self.last_change_ns = self.now_ns

    def on_stop(self, asked: Asked) -> None:
        self.stops_ns.append(self.now_ns)
        self.stops.append(asked)

    def on_answer(self, asked: Asked) -> None:
        self.last_change_ns = self.now_ns
        self.open[asked.method] -= 1
        follow = {
            "robot.stop": self._on_stopped,
            "robot.reset": self._on_reset,
            "parameter.write": self._on_written,
            "parameter.confirm": self._on_confirmed,
        }.get(asked.method)
        if follow is not None:
            follow(asked)

    def on_left(self, who: str) -> None:
        """What somebody has on trial ends now; what becomes of what they have asked for nobody is told."""
        for asked in self.waiting:
            if asked.who == who:
                asked.lost = True
                self._forget(asked)
                self.world.runtime.call_in(LOST_S, partial(self._give_up, asked, self.life))
        for trial in self.trials.values():
            if trial.who == who:
                trial.due_ns = min(trial.due_ns, self.now_ns)

    def on_others(self, *names: str) -> None:
        """Somebody else, or the loss of power, has changed these in the device."""
        for name in names:
            self.legit[name] = {self.value(name)}

    def on_damaged(self) -> None:
        """Nobody knows any more what is to be taken back."""
        for (_, name), change in self.undo.items():
            self.legit[name].add(counts(name, change.written_value))
        self.undo, self.undo_since, self.undo_bytes = {}, {}, b"?"

    def on_new_life(self, life: Life) -> None:
        """Of what was not answered nobody knows what became of it; what was on trial is so no more."""
        for asked in self.waiting:
            self._forget(asked)
        for trial in self.trials.values():
            trial.due_ns = min(trial.due_ns, self.now_ns)
        self.life, self.held, self.control_since_ns = life, False, None
        self.trips, self.tripped_since, self.stops = 0, {}, []
        self.open.clear()

    def look(self) -> None:
        """Between two tasks."""
        control = self.life.module("control")
        if (control is None) != (self.control_since_ns is None):
            self.control_since_ns = None if control is None else self.now_ns
        held = self.life.held
        if held and not self.held:
            self.held_since_ns = self.now_ns
        self.hold_ended |= self.held and not held and control is not None
        self.held = held
        if self.world.disk.changes != self._disk_seen:
            self._disk_seen = self.world.disk.changes
            self._look_at_undo()
        if self.now_ns - self.looked_ns >= LOOK_NS:
            self.looked_ns = self.now_ns
            self._look_at_guard()
            self.look_at_devices()

    def look_at_devices(self) -> None:
        now_ns = self.now_ns
        for name, device in self.world.devices.items():
            answers = device.answers and device.wire.hears
            _follow(self.healthy_since, name, now_ns, holds=answers)
            _follow(self.whole_since, name, now_ns, holds=answers and not device.faults.no_tpdo)
        for joint, axis in self.world.axes.items():
            _follow(self.enabled_since, joint, now_ns, holds=axis.enabled)
            _follow(self.rests_since, joint, now_ns, holds=not axis.enabled)
        self.runs_since = (self.runs_since or now_ns) if self.world.gait.runs else None

    # What follows from it

    def _forget(self, asked: Asked) -> None:
        """Nobody will know what became of it."""
        self.must_hold &= asked.method != "robot.reset"
        for name, value in asked.params.get("changes", {}).items():
            self.legit[name].add(counts(name, value))

    def _give_up(self, asked: Asked, life: Life) -> None:
        if life is self.life and asked.answered_ns is None:
            asked.answered_ns = self.now_ns
            self.open[asked.method] -= 1

    def _on_stopped(self, asked: Asked) -> None:
        self.must_hold |= asked.result is not None and asked.result.problem is None

    def _on_reset(self, asked: Asked) -> None:
        self.reset_ns = self.now_ns
        self.must_hold &= asked.result is None or asked.result.held

    def _on_written(self, asked: Asked) -> None:
        written = asked.result
        if written is not None and written.trial_s is not None:
            self.trials[written.write] = Trial(self.now_ns + round(written.trial_s * 1e9), asked.who)
            if asked.who not in self.life.people:
                self.on_left(asked.who)
        elif written is not None:
            self._settle(asked.params["changes"])

    def _on_confirmed(self, asked: Asked) -> None:
        if asked.result is not None:
            self._settle(asked.result.values)

    def _settle(self, values: dict[str, float]) -> None:
        for name, value in values.items():
            self.legit[name] = {counts(name, value)}

    def _on_ours(self, sent: Sent) -> None:
        device = self.world.at(sent.bus, sent.can_id & 0x7F)
        if device is None:
            return
        if sent.can_id & 0x780 == RPDO1:
            self._on_controlword(device, 0, int.from_bytes(sent.data[:2], "little"))
            torque = int.from_bytes(sent.data[2:4], "little")
            if torque != device.get(MAX_TORQUE):
                self._on_download(device, (MAX_TORQUE, 0), torque, sent.asked_ns)
        if sent.can_id & 0x780 != SDO_REQUEST or sent.data[0] >> 5 != 1:
            return
        self.last_change_ns = self.now_ns
        command, index, subindex = struct.unpack_from("<BHB", sent.data)
        value = int.from_bytes(sent.data[4 : 8 - (command >> 2 & 3)], "little")
        if index in range(CONTROLWORD, 0xA000, 0x800):
            self._on_controlword(device, (index - CONTROLWORD) // 0x800, value)
        self._on_download(device, (index, subindex), value, sent.asked_ns)

    def _on_download(self, device: Device, address: Address, value: int, asked_ns: int) -> None:
        name = NAMES.get((device.name, address))
        if name is not None:
            who, changed_ns = self.writer(name)
            seen = who == GATEWAY or asked_ns - changed_ns > SEEN_NS
            self.downloads.append(Download(asked_ns, name, value, self.value(name), seen))

    def _on_controlword(self, device: Device, axis: int, value: int) -> None:
        joint = next(name for name, at in JOINTS.items() if at == (device.name, axis))
        drive = self.world.axes[joint]
        self.controlwords.append(Commanded(joint, value, drive.state, drive.since_ns))
        if value & 0x86 == 0x02 or value & 0x82 == 0:  # quick stop, disable voltage
            self.stopped_at[joint] = self.now_ns

    def _look_at_undo(self) -> None:
        file = self.world.disk.files.get(f"{self.world.records}/undo.json")
        data = b"" if file is None else bytes(file.data)
        if data == self.undo_bytes:
            return
        self.undo_bytes = data
        undos: list[Undo] = msgspec.json.decode(data, type=list[Undo]) if data else []
        now = {(one.write, change.parameter): change for one in undos for change in one.changes}
        gone = (key for key in self.undo if key not in now)
        self.dropped += [(key[0], self.undo[key], tuple(undos)) for key in gone]
        self.undo_since = {key: self.undo_since.get(key, self.now_ns) for key in now}
        self.undo = now
        self.last_change_ns = self.now_ns

    def _look_at_guard(self) -> None:
        guard: Any = self.life.module("guard")
        if guard is None:
            return
        rules = [one for one in guard.info().rules if "quick_stop" in one.actions]
        tripped = {one.name: one.since_ns or 0 for one in rules if one.state == "tripped"}
        trips = sum(one.trips for one in rules)
        if trips > self.trips:
            self.stops_ns += tripped.values()
        self.trips = trips
        self.tripped_since = {name: self.tripped_since.get(name, self.now_ns) for name in tripped}


def _follow(since: dict[str, int], name: str, now_ns: int, *, holds: bool) -> None:
    """Keep since when something holds."""
    if holds:
        since.setdefault(name, now_ns)
    else:
        since.pop(name, None)
