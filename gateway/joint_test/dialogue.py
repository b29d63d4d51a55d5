"""The dialogue of a joint test: the checks and consent before it, and its supervision.

Everything is refused before the drive has power. `gwrms docs how-to/test-a-joint` says what is promised.
"""

import datetime
import math
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import msgspec

import eds
from drivers.bus.nmt import NmtState
from drivers.bus.pdo import NOT_VALID
from drivers.bus.rpdo import MAX_RPDOS, RPDO_PARAMETER, identifier
from drivers.bus.settings import Role
from drivers.bus.values import unsigned
from drivers.errors import DriverError, SettingsError, Unavailable
from drivers.joint.cia402 import ABORT_CONNECTION_OPTIONS, ENERGISED, QUICK_STOP_OPTIONS, option_text
from drivers.joint.drive import JointDrive
from drivers.joint.homing import MODES
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.scaling import SCALING_OBJECTS, rated_current, rated_torque, scalings
from gateway.commission.axes import Axis, answered, counts, number, state
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Ask, Moving, Say, Talk, press
from gateway.commission.homing_plan import MAX_CURRENT, MAX_TORQUE, TOLD, armed, option
from gateway.commission.joints import words
from gateway.commission.power import Power
from gateway.commission.powered_run import NotStopped, PoweredRunResult
from gateway.config.robot import JointTable, RobotConfig
from gateway.joint_test import limits as limiting
from gateway.joint_test import parameters, undo_file
from gateway.joint_test.guard_watch import Guarding
from gateway.joint_test.limits import AskedLimits, Drive, JointTestLimits, NotAllowed
from gateway.joint_test.motion import Wish, planned
from gateway.joint_test.recording import JointTestRecording
from gateway.joint_test.run import NEEDED, POSITION_MODE, READ_S, TORQUE_MODE, JointTestPlan, TestRun
from gateway.records.records import Records

LEAST_PERIOD_S, MOST_PERIOD_S = 0.005, 0.02
USUAL_PERIOD_S = 0.01
UP_S = 5.0
TICK_S = 0.02
LOW_LIMIT, HIGH_LIMIT = (0x607D, 1), (0x607D, 2)
PERIOD, EXPONENT = (0x60C2, 1), (0x60C2, 2)
MILLE = 1000.0
NO_PDO = NOT_VALID.to_bytes(4, "little")  # where the drive has none


@dataclass(frozen=True, slots=True)
class Test:
    """One joint of a robot's file, and what is wished."""

    __test__ = False  # for pytest
    config: RobotConfig
    joint: str
    wish: Wish
    asked: AskedLimits
    file: Path
    who: str
    records: Records

    @property
    def settings(self) -> JointTable:
        return self.config.joint[self.joint]

    @property
    def axis(self) -> Axis:
        return Axis(self.settings.node_id, self.settings.axis)

    @property
    def mode(self) -> int:
        """The mode of operation in which it is moved."""
        return TORQUE_MODE if self.wish.kind.by_torque else POSITION_MODE

    @property
    def left(self) -> Path:
        """File of the values to be restored after an interruption."""
        return self.records.folder.joint_test

    def tell(self, what: str, **details: object) -> None:
        """Write it into the journal; raises `OSError`."""
        self.records.journal.append(self.who, what, **details).result()

    @property
    def phrase(self) -> str:
        """The phrase to be typed."""
        wide = f"{self.joint} by {math.degrees(self.wish.amplitude):g} deg"
        return f"move {wide} with {self.wish.torque:g} Nm" if self.wish.kind.by_torque else f"move {wide}"


@dataclass(frozen=True, slots=True)
class DriveFacts:
    """Facts about the drive before it has power."""

    angle: float
    period_s: float
    limits: JointTestLimits
    description: eds.Description
    options: Mapping[int, int | None]


def tested(bench: Bench, others: Mapping[str, Bench], test: Test) -> Talk[PoweredRunResult | None]:
    """Ask, move, record; `None` where nothing got power. `others` are the further buses of the robot.

    Raises:
        NotAllowed: it must not be moved so.
        NotStopped: a drive has not confirmed that it is disabled.
        DriverError: the drive does not answer, or somebody else is on the bus.
        OSError: the recording cannot be written.

    """
    _may_be_led(test)
    yield Say("Asking whether every other drive is off …")
    _all_off(bench, others, test)
    benches = {**others, test.settings.bus: bench}
    yield from undo_file.put_right(test.left, benches, test.config.joint, test.tell)
    if why := (yield from armed(bench, test.axis)):
        raise NotAllowed(why)
    known = yield from answered(lambda: _known(bench, test))
    if not (yield from _agreed(test, known)):
        yield Say("Nothing gets power.")
        return None
    _all_off(bench, others, test)  # the phrase may have taken its time
    return (yield from _moved(bench, test, known))


def _may_be_led(test: Test) -> None:
    if test.config.gateway.role is not Role.MASTER:
        raise NotAllowed(
            'this robot is led by somebody else: only where its file says role = "master" in [gateway], as '
            "on a bench, may this command lead its bus"
        )
    if test.settings.sdo_cob_ids is not None:
        raise NotAllowed("it is asked by an SDO channel of its own (sdo_cob_ids), which this does not use")


def _all_off(bench: Bench, others: Mapping[str, Bench], test: Test) -> None:
    for name, joint in test.config.joint.items():
        _is_off(others[joint.bus] if name != test.joint else bench, test.config, name)


def _is_off(bench: Bench, config: RobotConfig, name: str) -> None:
    """Unknown counts as under power."""
    axis = Axis(config.joint[name].node_id, config.joint[name].axis)
    try:
        found = state(bench, axis)
    except DriverError as error:
        raise NotAllowed(f"nobody knows whether the {words(name)} has power: {error}") from error
    if found is None or found in ENERGISED:
        what = "in no known state" if found is None else found.words
        raise NotAllowed(
            f"the {words(name)} ({axis}) is {what}: every drive must be off before one is tested"
        )


def _known(bench: Bench, test: Test) -> DriveFacts:
    axis, settings = test.axis, test.settings
    description = eds.load(eds.locate(settings.eds, test.config.path), settings.node_id)
    readings = {name: number(bench, axis, *at) for name, at in SCALING_OBJECTS.items()}
    linear = scalings(settings, readings)["position"]
    position = counts(bench, axis)
    if position is None or linear is None:
        raise Unavailable("its drive tells no position (6064h)")
    ends = [_signed(bench, axis, *at) for at in (LOW_LIMIT, HIGH_LIMIT)]
    angles = sorted(one * linear.scale + linear.offset for one in ends if one is not None)
    soft = angles if len(angles) == 2 and angles[0] < angles[1] else (None, None)
    rated = rated_torque(settings, readings)
    shares = [number(bench, axis, index) for index in (MAX_CURRENT, MAX_TORQUE)]
    most = min((one for one in shares if one), default=None)
    drive = Drive(
        low=soft[0],
        high=soft[1],
        torque=None if most is None or rated is None else most / MILLE * rated,
        rated_torque=rated,
        rated_current=rated_current(settings, readings),
    )
    _has_mode(bench, test)
    period_s = _period(bench, axis)
    angle = position * linear.scale + linear.offset
    rules = {} if test.config.guard is None else test.config.guard.rule
    limits = limiting.limits(test.wish, test.asked, drive, rules, test.joint, angle, period_s)
    return DriveFacts(
        angle, period_s, limits, description, {index: option(bench, axis, index) for index in TOLD}
    )


def _signed(bench: Bench, axis: Axis, index: int, subindex: int) -> int | None:
    data = bench.read(axis.node, axis.index(index), subindex)
    return None if data is None else int.from_bytes(data[:4], "little", signed=True)


def _has_mode(bench: Bench, test: Test) -> None:
    modes = number(bench, test.axis, MODES)
    if modes is not None and not modes >> test.mode - 1 & 1:
        raise NotAllowed(f"its drive has no mode {test.mode} (6502h), by which it is moved SYNC by SYNC")


def _period(bench: Bench, axis: Axis) -> float:
    """Return the SYNC period that the drive expects (60C2h), as far as this computer can keep it."""
    value = number(bench, axis, *PERIOD)
    exponent = bench.read(axis.node, axis.index(EXPONENT[0]), EXPONENT[1])
    if not value or exponent is None:
        return USUAL_PERIOD_S
    period_s = value * 10.0 ** int.from_bytes(exponent[:1], "little", signed=True)
    if not LEAST_PERIOD_S <= period_s <= MOST_PERIOD_S:
        raise NotAllowed(
            f"its drive expects a target every {period_s * 1000:g} ms (60C2h): set it to "
            f"{LEAST_PERIOD_S * 1000:g} … {MOST_PERIOD_S * 1000:g} ms for a test"
        )
    return period_s


# The word.


def _agreed(test: Test, known: DriveFacts) -> Talk[bool]:
    yield from press(
        f"The drive of the {words(test.joint)} is to get power. The joint is free on a bench: nobody wears "
        "the robot, all hands are off it, the hardware emergency stop is within reach, STO is released."
    )
    yield Say("\n".join(explained(test, known)))
    typed = yield Ask(
        f"Type  {test.phrase}  to put it under power and begin; anything else: nothing gets power."
    )
    return typed == test.phrase


def explained(test: Test, known: DriveFacts) -> Iterator[str]:
    """Yield the plan of the test for the person, line by line."""
    limits, wish = known.limits, test.wish
    low, high, _, time_s = planned(wish, known.period_s)
    yield f"What will happen, to the {words(test.joint)} ({test.axis}) alone: a {wish.kind} test"
    yield (
        f"  it moves, from {math.degrees(known.angle):.1f}°, between {math.degrees(known.angle + low):.1f}° "
        f"and {math.degrees(known.angle + high):.1f}°, for {time_s:.0f} s, a target each "
        f"{known.period_s * 1000:g} ms"
    )
    yield (
        f"  power is taken beyond {math.degrees(limits.low):.1f}° … {math.degrees(limits.high):.1f}°, "
        f"{math.degrees(limits.speed):.0f}°/s, {limits.torque:.3g} N·m"
        + ("" if limits.current is None else f", {limits.current:.3g} A")
        + f", {math.degrees(limits.lag):.1f}° behind its target, {limits.time_s:.0f} s, a cycle that is "
        f"{limits.late_s * 1000:.0f} ms late, and by any rule of the guard"
    )
    on_stop = option_text(QUICK_STOP_OPTIONS, known.options[TOLD[0]])
    yield f"  a stop: the drive {on_stop} (605Ah), and is disabled"
    on_loss = option_text(ABORT_CONNECTION_OPTIONS, known.options[TOLD[1]])
    yield f"  if this program dies: the drive {on_loss} (6007h), a quarter of a second later"
    yield f"  recorded into {test.file}"
    yield "  STOP: Enter, at any time; so do Ctrl-C, a closed terminal, another master, and a drive that errs"


# Under power.


def _moved(bench: Bench, test: Test, known: DriveFacts) -> Talk[PoweredRunResult | None]:
    yield Say("Listening whether somebody else is on the bus; then it begins …")
    beside = [one for one in test.config.joint.values() if one.bus == test.settings.bus]
    nodes = {one.node_id for one in beside}
    taken = {can_id: one.node_id for one in beside for can_id in _taken(bench, test, one)}
    try:
        with (
            bench.power(test.settings, known.description, nodes) as power,
            _reader(test, power, known) as reader,
            Guarding(test.config, reader, power.bus) as guarding,
        ):
            power.foreign.hear(taken)
            outcome = yield from _led(test, known, power, reader, guarding)
    except DriverError as error:
        yield Say(f"Nothing got power: {error}.")
        return None
    if outcome is not None and power.left is not None:
        yield Say(f"{power.left}.")
    return outcome


def _taken(bench: Bench, test: Test, joint: JointTable) -> Iterator[int]:
    """Yield the identifiers of the process data that a drive receives, as configured now."""
    description = eds.load(eds.locate(joint.eds, test.config.path), joint.node_id)
    for index in range(RPDO_PARAMETER, RPDO_PARAMETER + MAX_RPDOS):
        if index in description.object_dictionary:
            cob_id = unsigned(bench.read(joint.node_id, index, 1) or NO_PDO)
            if not cob_id & NOT_VALID:
                yield identifier(cob_id)


@contextmanager
def _reader(test: Test, power: Power, known: DriveFacts) -> Iterator[JointDrive]:
    """Return the joint as a gateway follows it; its PDOs are as they are."""
    settings = msgspec.structs.replace(test.settings, configure_pdos=False)
    reader = JointDrive(test.joint, settings, power.bus, known.description)
    reader.start()
    try:
        until = time.monotonic() + UP_S
        while reader.reading is None or power.objection is not None or not _operational(power):
            power.foreign.check()
            if time.monotonic() > until:
                raise Unavailable(power.objection or "the drive did not come up")
            power.heartbeat.feed()
            threading.Event().wait(TICK_S)
        yield reader
    finally:
        reader.stop()


def _operational(power: Power) -> bool:
    """Return whether its heartbeat says so; one from before our NMT start may still be under way."""
    life = power.node.life
    return life.nmt_state is NmtState.OPERATIONAL or life.timeout_s is None


def _led(
    test: Test, known: DriveFacts, power: Power, reader: JointDrive, guarding: Guarding
) -> Talk[PoweredRunResult | None]:
    missing = [name for name in NEEDED if name not in reader.synchronous]
    missing += [] if {"torque", "current"} & reader.synchronous else ["torque or current"]
    if missing:
        raise SettingsError(
            f"its {' and '.join(missing)} does not come with each SYNC: map it into a TPDO of transmission "
            "type 1 (gwrms docs how-to/wire-a-joint)"
        )
    before = yield from _parameters(power, known)
    if before is None:
        return None
    plan = JointTestPlan(test.wish, known.limits, known.angle, known.period_s, before)
    head = _head(test, known, before, guarding)
    with JointTestRecording(test.file, head, by_torque=test.wish.kind.by_torque) as recording:
        _keep(test, before)
        run = TestRun(power, reader, guarding, plan)
        try:
            outcome = yield from _followed(run, test, recording)
        finally:
            run.finish()
            if run.restored:
                undo_file.settled(test.left)
    result = (
        f"It is recorded in {test.file}" if outcome.problem is None else f"It was ended: {outcome.problem}"
    )
    yield Say(f"{result}; {outcome.text}.")
    return outcome


def _keep(test: Test, before: parameters.Parameters) -> None:
    """Record the coming changes, so that they can be restored even after this program's death."""
    changes = undo_file.changes(before, test.mode, test.settings.axis * AXIS_OFFSET)
    if changes:
        place = (test.joint, test.settings.bus, test.settings.node_id)
        undo_file.keep(test.left, undo_file.Unfinished(*place, _now(), test.who, changes))


def _parameters(power: Power, known: DriveFacts) -> Talk[parameters.Parameters | None]:
    """Read while nothing has power; `None` where a stop came."""
    offset = power.drive.settings.axis * AXIS_OFFSET
    stopped = threading.Event()
    future = power.node.run(
        lambda sdo: parameters.read(sdo, known.description, offset, lambda: not stopped.is_set())
    )
    until = time.monotonic() + READ_S
    try:
        while not future.done():
            power.heartbeat.feed()
            why = yield Moving("Its parameters are read, without power. STOP: Enter.")
            if why or time.monotonic() > until:
                yield Say(f"Nothing got power: {why or 'its parameters could not be read in time'}.")
                return None
    finally:
        stopped.set()
    return future.result()


def _followed(run: TestRun, test: Test, recording: JointTestRecording) -> Talk[PoweredRunResult]:
    """Every way out of here ends it, and waits for that."""
    try:
        run.start()
        while not run.done:
            why = yield Moving(
                f"The {words(test.joint)} is under power. STOP: Enter.  {run.said} "
                f"({math.degrees(run.moved):+.1f}°)"
            )
            if why:
                run.stop(why)
            else:
                run.keep()
            recording.add(run.take())
    finally:
        outcome = run.end()
        try:
            _close(recording, run, outcome)
        finally:
            if not outcome.off:
                raise NotStopped(f"{words(test.joint)}: {outcome.problem or 'tested'}; {outcome.text}")
    return outcome


def _close(recording: JointTestRecording, run: TestRun, outcome: PoweredRunResult) -> None:
    with suppress(OSError):
        recording.add(run.take())
        recording.end(problem=outcome.problem, off=outcome.off, state=outcome.state, late_s=run.late_s)


def _now() -> str:
    return datetime.datetime.now(datetime.UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _head(test: Test, known: DriveFacts, before: parameters.Parameters, guarding: Guarding) -> dict[str, Any]:
    settings = test.settings
    return {
        "robot": test.config.robot.name,
        "joint": test.joint,
        "test": str(test.wish.kind),
        "began": _now(),
        "who": test.who,
        "wish": asdict(test.wish),
        "limits": asdict(known.limits),
        "period_s": known.period_s,
        "angle": known.angle,
        "drive": {
            "node_id": settings.node_id,
            "axis": settings.axis,
            "eds": known.description.path.name,
            "counts_per_revolution": settings.counts_per_revolution,
            "gear_ratio": settings.gear_ratio,
        },
        "guard": guarding.rules,
        "parameters": before,
    }
