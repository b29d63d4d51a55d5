"""Everything that can happen: what people ask for, what devices and buses do, what becomes of the gateway.

An event acts in one moment and waits for nothing; `possible` says where it would change anything at all.
"""

from collections.abc import Callable
from dataclasses import dataclass

from tests.explore.disk import SYNC_NS
from tests.explore.node import LATE_S, SLOW_S, Faults
from tests.explore.parameters import PARAMETERS, following
from tests.explore.stage import Stage

Act = Callable[[Stage], object]
Possible = Callable[[Stage], bool]

LEASE_S, TRIAL_S = 6.0, 1.5
LONG_S = 60.0
CROWD, FLOOD = 70, 320
PUSHED = 1.5  # rad, beyond every limit
SLOW_SYNC_NS = 800_000_000
LEADER, OTHER = "ada", "ben"


@dataclass(frozen=True, slots=True)
class Event:
    """One thing that can happen."""

    name: str
    act: Act
    possible: Possible = lambda _stage: True
    weight: float = 1.0  # among the others in a random order


EVENTS: dict[str, Event] = {}


def _event(name: str, act: Act, possible: Possible = lambda _stage: True, *, weight: float = 1.0) -> None:
    EVENTS[name] = Event(name, act, possible, weight)


# People


def _write(*names: str, trial_s: float | None = None) -> Act:
    def act(stage: Stage) -> None:
        changes = {name: following(name, stage.facts.value(name)) for name in names}
        more = {} if trial_s is None else {"trial_s": trial_s}
        stage.ask(LEADER, "parameter.write", changes=changes, **more)

    return act


def _latest_trial(stage: Stage) -> int | None:
    written = (one.result for one in reversed(stage.life.asked) if one.method == "parameter.write")
    return next((one.write for one in written if one is not None and one.trial_s is not None), None)


def _about_trial(method: str) -> Act:
    return lambda stage: stage.ask(LEADER, method, write=_latest_trial(stage))


def _asks(who: str, method: str, **params: object) -> Act:
    return lambda stage: stage.ask(who, method, **params)


def _has_trial(stage: Stage) -> bool:
    return _latest_trial(stage) is not None and bool(stage.facts.undo)


_event("ada stops", _asks(LEADER, "robot.stop", reason="ada"), weight=2.0)
_event("ben stops", _asks(OTHER, "robot.stop", reason="ben"), weight=2.0)
_event("ada resets", _asks(LEADER, "robot.reset"), weight=3.0)
_event("ada leads", _asks(LEADER, "control.acquire", ttl_s=LEASE_S), weight=3.0)
_event("ada gives back", _asks(LEADER, "control.release"))
_event("ben leads", _asks(OTHER, "control.acquire", ttl_s=LEASE_S))
_event("ben resets", _asks(OTHER, "robot.reset"))
_event("ada dies", lambda stage: stage.leave(LEADER), lambda stage: LEADER in stage.life.people)
_event("ada leads for long", _asks(LEADER, "control.acquire", ttl_s=LONG_S), weight=0.3)
_event("try for long", _write("gait.cycle_time", trial_s=LONG_S), weight=0.3)
_event(
    "ada says no more",
    lambda stage: stage.leave(LEADER, gone=False),
    lambda stage: LEADER in stage.life.people,
)
_event(
    "ada streams",
    _asks(LEADER, "stream.start", modules=["component"], channels=["knee.position"], rate_hz=2.0),
    lambda stage: LEADER in stage.life.people,
    weight=0.5,
)
_event("ada enables", _asks(LEADER, "robot.enable"), lambda stage: stage.world.role == "master")
_event("ada stores", _asks(LEADER, "parameter.store", component="knee"))
_event("write step", _write("gait.step_length"))
_event("write torque", _write("knee.max_torque"))
_event("write run", _write("gait.run"))
_event("write both", _write("gait.cycle_time", "ankle.max_torque"))
_event("try step", _write("gait.step_length", trial_s=TRIAL_S))
_event("try torque", _write("knee.max_torque", trial_s=TRIAL_S))
_event("try run", _write("gait.run", trial_s=TRIAL_S))
_event("try both", _write("gait.step_length", "ankle.max_torque", trial_s=TRIAL_S))
_event("confirm", _about_trial("parameter.confirm"), _has_trial)
_event("revert", _about_trial("parameter.revert"), _has_trial)


# Forms in which a stop may come that are no request, strictly.
_ODD = (
    b'{"jsonrpc":"2.0","id":9001,"method":"robot.stop","params":["odd"]}',
    b'{"id":9001,"method":"robot.stop","params":{"reason":"odd"}}',
    b'{"jsonrpc":"2.0","id":9001,"method":"robot.stop","params":{"reason":"odd","now":true}}',
    b'{"jsonrpc":"2.0","id":9001.5,"method":"robot.stop"}',
    b'[{"jsonrpc":"2.0","id":9001,"method":"robot.stop"}]',
    b'{"jsonrpc":"2.0","id":9001,"method":"robot.stop","params":{"reason":"\xe9"}}',
)


def _stop_oddly(stage: Stage) -> None:
    stage.stop_by(OTHER, _ODD[stage.runtime.steps % len(_ODD)] + b"\n")


def _crowd(stage: Stage) -> None:
    """So many connect that nobody else finds a place, and say nothing."""
    for _ in range(CROWD):
        stage.life.connect()


def _flood(stage: Stage) -> None:
    """More requests than may wait."""
    line = b'{"jsonrpc":"2.0","id":"flood","method":"parameter.read","params":{"names":["gait.run"]}}\n'
    stage.life.say(LEADER, line * FLOOD)


_event("ben stops oddly", _stop_oddly, weight=0.5)
_event("a crowd comes", _crowd, weight=0.2)
_event("ada floods", _flood, weight=0.2)


# What the robot does


def _push(joint: str, by: float) -> Act:
    def act(stage: Stage) -> None:
        axis = stage.world.axes[joint]
        axis.pushed = by
        axis.drive.tell()

    return act


def _bump(joint: str) -> Act:
    """Pushed for a moment, and well again."""

    def act(stage: Stage) -> None:
        _push(joint, PUSHED)(stage)
        stage.runtime.call_in(0.12, lambda: _push(joint, 0.0)(stage))

    return act


def _is_pushed(joint: str, pushed: bool) -> Possible:
    return lambda stage: (stage.world.axes[joint].pushed != 0.0) is pushed


for _joint, _what in (("knee", "stops"), ("hip", "takes back")):
    _event(f"{_joint} is bumped", _bump(_joint), _is_pushed(_joint, False))
    _event(f"{_joint} is pushed", _push(_joint, PUSHED), _is_pushed(_joint, False))
    _event(f"{_joint} is let go", _push(_joint, 0.0), _is_pushed(_joint, True))


def _start_gait(stage: Stage) -> None:
    """Somebody starts the controller, not through us."""
    stage.world.gait.write("somebody", 0x2000, 0, b"\1")
    stage.facts.on_others("gait.run")


def _stop_gait(stage: Stage) -> None:
    stage.world.gait.write("somebody", 0x2000, 0, b"\0")
    stage.facts.on_others("gait.run")


def _foreign_write(stage: Stage) -> None:
    stage.world.gait.write("somebody", 0x2001, 0, (333).to_bytes(2, "little"))
    stage.facts.on_others("gait.step_length")


def _enable(joint: str) -> Act:
    """Another master enables one drive, in one go."""

    def act(stage: Stage) -> None:
        for controlword in (0x06, 0x07, 0x0F):
            stage.world.axes[joint].command("somebody", controlword)

    return act


_event("gait is started", _start_gait, lambda stage: not stage.world.gait.runs)
_event("gait is stopped", _stop_gait, lambda stage: stage.world.gait.runs)
_event("somebody writes step", _foreign_write)
for _joint in ("knee", "ankle"):
    _event(f"somebody enables {_joint}", _enable(_joint))
    _event(f"{_joint} fails", lambda stage, joint=_joint: stage.world.axes[joint].fail())  # type: ignore[misc]
_event(
    "hip ignores stops",
    lambda stage: setattr(stage.world.axes["hip"], "ignores_quick_stop", True),
    lambda stage: not stage.world.axes["hip"].ignores_quick_stop,
)


# What goes wrong


def _fault(device: str, **faults: object) -> Act:
    def act(stage: Stage) -> None:
        for name, value in faults.items():
            setattr(stage.world.devices[device].faults, name, value)

    return act


def _is_well(device: str) -> Possible:
    return lambda stage: stage.world.devices[device].faults == Faults()


def _boot(device: str) -> Act:
    def act(stage: Stage) -> None:
        stage.world.devices[device].boot()
        stage.facts.on_others(*(name for name, one in PARAMETERS.items() if one.device == device))

    return act


for _device in ("left", "right", "gait"):
    _event(f"{_device} dies", _fault(_device, dead=True), _is_well(_device))
    _event(f"{_device} boots", _boot(_device), _is_well(_device))
    _event(f"{_device} is late", _fault(_device, late_s=LATE_S), _is_well(_device))
    _event(f"{_device} loses an answer", _fault(_device, lose=1), _is_well(_device))
_event("gait doubles answers", _fault("gait", doubled=True), _is_well("gait"))
_event("left is slow", _fault("left", late_s=SLOW_S), _is_well("left"))
_event("right is slow", _fault("right", late_s=SLOW_S), _is_well("right"))
_event("left refuses a write", _fault("left", refuse=1), _is_well("left"))
_event("gait refuses a write", _fault("gait", refuse=1), _is_well("gait"))
_event("gait hears no SDO", _fault("gait", no_sdo=True), _is_well("gait"))
_event("right sends no TPDO", _fault("right", no_tpdo=True), _is_well("right"))
_event("left sends no TPDO", _fault("left", no_tpdo=True), _is_well("left"))
for _bus in ("left", "right"):
    _event(
        f"bus {_bus} is blocked",
        lambda stage, bus=_bus: stage.world.wires[bus].block(True),  # type: ignore[misc]
        lambda stage, bus=_bus: not stage.world.wires[bus].blocked,  # type: ignore[misc]
    )
_event(
    "bus left is gone",
    lambda stage: stage.world.wires["left"].lose(True),
    lambda stage: not stage.world.wires["left"].gone,
)
_event("bus left breaks", lambda stage: setattr(stage.world.wires["left"], "breaks", True), weight=0.3)


def heal(stage: Stage) -> None:
    """Nothing is wrong any more."""
    for device in stage.world.devices.values():
        was_dead, device.faults = device.faults.dead, Faults()
        if was_dead:
            device.boot()
    for wire in stage.world.wires.values():
        if wire.blocked:
            wire.block(False)
        if wire.gone:
            wire.lose(False)
    for axis in stage.world.axes.values():
        axis.pushed, axis.ignores_quick_stop = 0.0, False
    stage.world.disk.heal()


def _something_is_wrong(stage: Stage) -> bool:
    world = stage.world
    devices = any(one.faults != Faults() for one in world.devices.values())
    return devices or any(one.blocked or one.gone for one in world.wires.values()) or not _disk_is_well(stage)


_event("all is well", heal, _something_is_wrong, weight=3.0)

# The gateway's computer

_event("gateway is killed", lambda stage: stage.restart())
_event("power is lost", lambda stage: stage.restart(power=True))


def _disk(**faults: object) -> Act:
    def act(stage: Stage) -> None:
        for name, value in faults.items():
            setattr(stage.world.disk, name, value)

    return act


def _disk_is_well(stage: Stage) -> bool:
    disk = stage.world.disk
    return not disk.full and not disk.read_only and disk.sync_ns == SYNC_NS


def _damage(stage: Stage) -> None:
    """What the file said nobody knows any more."""
    stage.world.disk.files[f"{stage.world.records}/undo.json"].data[:] = b"?"
    stage.world.disk.make_durable()
    stage.facts.on_damaged()


_event("disk is full", _disk(full=True), _disk_is_well, weight=0.5)
_event("disk is read only", _disk(read_only=True), _disk_is_well, weight=0.5)
_event("disk is slow", _disk(sync_ns=SLOW_SYNC_NS), _disk_is_well)


def _damage_for_good(stage: Stage) -> None:
    _damage(stage)
    _disk(read_only=True)(stage)


_event("undo is damaged", _damage, lambda stage: bool(stage.facts.undo), weight=0.5)
_event("undo is damaged for good", _damage_for_good, lambda stage: bool(stage.facts.undo), weight=0.5)
_event(
    "a thread is late",
    lambda stage: stage.runtime.delay_next(),
    lambda stage: len(stage.runtime.ready) > 1,
    weight=6.0,
)
