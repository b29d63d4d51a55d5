"""A test under power: SYNC by SYNC a target, a sample, and a look whether all is as it must be.

The drive follows its target by SYNC (CiA 402 mode 8, of a relay mode 10). The target goes by SDO, each
confirmed, and never with a controlword beside it: nothing that is sent in a cycle could enable a drive again
that was stopped. Everything else is the powered run's.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

from drivers.bus.cycles import next_due
from drivers.bus.fields import Linear
from drivers.bus.master import SYNC
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.sender import always
from drivers.joint.axis import POSITION_ACTUAL
from drivers.joint.cia402 import DriveState, drive_state
from drivers.joint.drive import JointDrive
from drivers.joint.homing import MODE
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.scaling import scalings
from drivers.realtime_priority import make_realtime
from drivers.samples import Sample
from gateway.commission.power import Power
from gateway.commission.powered_run import PoweredRun, RunEnded
from gateway.joint_test import parameters
from gateway.joint_test.guard_watch import Guarding
from gateway.joint_test.limits import JointTestLimits
from gateway.joint_test.motion import Wish, motion
from gateway.joint_test.recording import Row

POSITION_MODE, TORQUE_MODE = 8, 10
TARGET_POSITION, TARGET_TORQUE = (0x607A, 4), (0x6071, 2)
HOLD_S = 0.3  # where it stands, before anything moves
DRIFT = math.radians(0.5)  # that it may do so then
SPEED_S = 0.05  # over which a speed is measured
NEEDED = ("position", "statusword")
READ_S = 30.0  # for its parameters to be read


@dataclass(frozen=True, slots=True)
class JointTestPlan:
    """Plan of a test: motion and limits, SYNC by SYNC."""

    wish: Wish
    limits: JointTestLimits
    angle: float  # rad, where it stood when that was agreed to
    period_s: float
    parameters: parameters.Parameters  # as they were before


@dataclass(frozen=True, slots=True)
class DriveSample:
    """The drive's values after one SYNC; `None` for those that its PDOs lack."""

    sync_ns: int
    stamp_ns: int
    position: float
    statusword: int
    velocity: float | None
    torque: float | None
    current: float | None


class JointMonitor:
    """The newest values of a joint, each as it came by PDO after a SYNC."""

    def __init__(self, reader: JointDrive) -> None:
        self._latest = reader.latest
        self.index = {channel.quantity: at for at, channel in enumerate(reader.channels)}
        self.brings = reader.synchronous
        self._came = threading.Event()
        self._end = self._latest.subscribe(self._on_sample)

    def _on_sample(self, _sample: Sample) -> None:
        self._came.set()

    def close(self) -> None:
        self._end()

    def after(self, sync_ns: int, within_s: float) -> DriveSample | None:
        """Return all that comes with each SYNC; `None` where it stays away."""
        wanted = [self.index[name] for name in self.brings]
        deadline = time.monotonic() + within_s
        while any((self._latest.stamp_ns(index) or 0) < sync_ns for index in wanted):
            left = deadline - time.monotonic()
            if left <= 0:
                return None
            self._came.wait(left)
            self._came.clear()
        return self._seen(sync_ns)

    def _seen(self, sync_ns: int) -> DriveSample | None:
        position, statusword = self._value("position"), self._value("statusword")
        if position is None or statusword is None:
            return None
        return DriveSample(
            sync_ns,
            self._latest.stamp_ns(self.index["position"]) or 0,
            position,
            int(statusword),
            self._value("velocity"),
            self._value("torque"),
            self._value("current"),
        )

    def _value(self, name: str) -> float | None:
        if name not in self.brings:
            return None
        return self._latest.read(self.index[name], time.monotonic_ns())[0]


class TestRun(PoweredRun):
    """Between `start` and `end`; `take` gives the samples that have come since."""

    __test__ = False  # for pytest
    name = "joint test"

    def __init__(self, power: Power, reader: JointDrive, guarding: Guarding, plan: JointTestPlan) -> None:
        super().__init__(power)
        self.moved = 0.0  # rad
        self.restored = False  # whether all parameters were read, and are as before
        self._reader = reader
        self._guarding = guarding
        self._plan = plan
        self._by_torque = plan.wish.kind.by_torque
        self._watch = JointMonitor(reader)
        self._rows: deque[Row] = deque()
        self._way: deque[tuple[int, float]] = deque()
        self._start = 0.0
        self._late_s = 0.0  # the worst of all cycles

    @property
    def late_s(self) -> float:
        """By how much the latest of all cycles came after its time."""
        return self._late_s

    def take(self) -> list[Row]:
        """Return the samples since the last time."""
        return [self._rows.popleft() for _ in range(len(self._rows))]

    # In the thread.

    def _set_up(self) -> None:
        mode = TORQUE_MODE if self._by_torque else POSITION_MODE
        self._wait(self._power.drive.ask(lambda axis: axis.write(MODE, bytes([mode]))))
        data = self._wait(self._power.drive.ask(lambda axis: axis.read(POSITION_ACTUAL, 4)))
        linear = self._linear("position")
        self._check_place(int.from_bytes(data, "little", signed=True) * linear.scale + linear.offset)

    def _act(self) -> None:
        make_realtime()
        began = time.monotonic()
        self._start = self._hold()
        self._check_place(self._start)
        self.said = f"{self._plan.wish.kind} test"
        targets = motion(self._plan.wish, self._plan.period_s)
        target = next(targets)
        due = time.monotonic()
        while True:
            self._aim(target)
            seen = self._cycle(due)
            self._keep(seen, target)
            self._judge(seen, target)
            self._check_time(began)
            try:
                target = targets.send(seen.position - self._start)
            except StopIteration:
                return
            due = next_due(due, self._plan.period_s, time.monotonic())

    def _hold(self) -> float:
        """Let it stand where it is; returns where that is. A joint that moves then is not begun with."""
        due = time.monotonic()
        first = self._cycle(due)
        while not self._by_torque and due - HOLD_S < time.monotonic():
            due += self._plan.period_s
            seen = self._cycle(due)
            self._judge(seen, None)
            if abs(seen.position - first.position) > DRIFT:
                raise RunEnded("the joint does not hold still where it was enabled")
            if seen.sync_ns - first.sync_ns > HOLD_S * 1e9:
                return seen.position
        return first.position

    def _cycle(self, due: float) -> DriveSample:
        """Send one SYNC at its time, and return what the drive answers."""
        while (left := due - time.monotonic()) > 0:
            self._rest(left)
        self._check()
        late_s = time.monotonic() - due
        self._late_s = max(self._late_s, late_s)
        if late_s > self._plan.limits.late_s:
            raise RunEnded(
                f"a cycle came {late_s * 1000:.0f} ms after its time: this computer is too busy (--late)"
            )
        sync_ns = time.monotonic_ns()
        self._power.bus.send(SYNC, b"")
        seen = self._watch.after(sync_ns, self._plan.limits.late_s)
        self._check()
        if seen is None:
            raise RunEnded("the drive's PDOs stay away after a SYNC")
        return seen

    def _aim(self, target: float) -> None:
        """Send the target of the next SYNC, in the drive's own units, confirmed by the drive."""
        linear = self._linear("torque" if self._by_torque else "position")
        value = target if self._by_torque else self._start + target
        (index, size), counts = (
            TARGET_TORQUE if self._by_torque else TARGET_POSITION,
            round((value - linear.offset) / linear.scale),
        )
        data = (counts & (1 << 8 * size) - 1).to_bytes(size, "little")
        self._wait(self._power.drive.ask(lambda axis: axis.write(index, data)))

    def _linear(self, quantity: str) -> Linear:
        readings = self._reader.reading
        linears = scalings(self._reader.settings, {} if readings is None else readings.scaling)
        linear = linears[quantity]
        if linear is None:
            raise RunEnded("the drive has come up anew, or nobody knows its units any more")
        return linear

    def _keep(self, seen: DriveSample, target: float) -> None:
        self.moved = seen.position - self._start
        aimed = target if self._by_torque else self._start + target
        self._rows.append(
            (
                seen.sync_ns,
                seen.stamp_ns,
                aimed,
                seen.position,
                seen.velocity,
                seen.torque,
                seen.current,
                seen.statusword,
            )
        )

    # Whether all is as it must be.

    def _check_place(self, angle: float) -> None:
        """Check that it still stands where it was when somebody agreed to the motion."""
        plan = self._plan
        if abs(angle - plan.angle) > DRIFT:
            raise RunEnded(
                f"the joint was moved: it stood at {math.degrees(plan.angle):.1f}° when its motion was "
                f"agreed to, and is at {math.degrees(angle):.1f}°. Begin again"
            )

    def _objection(self) -> str | None:
        return super()._objection() or self._guarding.tripped

    def _check_time(self, began: float) -> None:
        if time.monotonic() - began > self._plan.limits.time_s:
            raise RunEnded(f"it was not over within {self._plan.limits.time_s:.0f} s")

    def _judge(self, seen: DriveSample, target: float | None) -> None:
        limits = self._plan.limits
        self._guarding.look()
        state = drive_state(seen.statusword)
        if state is not DriveState.OPERATION_ENABLED:
            words = "no state of CiA 402" if state is None else state.words
            raise RunEnded(f"the drive has left operation by itself: {words}{self._error_code()}")
        emcy = self._power.node.life.active_emcy
        if emcy is not None:
            raise RunEnded(f"the drive reports {emcy.text(self._power.node.description.vendor_id)}")
        if not limits.low <= seen.position <= limits.high:
            raise RunEnded(f"the joint has left its limits: it is at {math.degrees(seen.position):.1f}°")
        away = abs(seen.position - self._start)
        if self._by_torque and target is not None and away > self._plan.wish.amplitude:
            raise RunEnded(f"the joint swings by {math.degrees(away):.1f}°, further than was told")
        if (
            not self._by_torque
            and target is not None
            and abs(self._start + target - seen.position) > limits.lag
        ):
            raise RunEnded(
                f"the joint is more than {math.degrees(limits.lag):.1f}° behind its target{self._jerk()}"
            )
        self._judge_speed(seen)
        for what, value, most, unit in (
            ("torque", seen.torque, limits.torque, "N·m"),
            ("current", seen.current, limits.current, "A"),
        ):
            if value is not None and most is not None and abs(value) > most:
                raise RunEnded(
                    f"its {what} is {value:.3g} {unit}, beyond the limit of {most:.3g} {unit} "
                    f"(--max-torque){self._jerk()}"
                )

    def _jerk(self) -> str:
        """In words, that a late cycle may be why."""
        if self._late_s <= self._plan.period_s:
            return ""
        return f"; a cycle came {self._late_s * 1000:.0f} ms late, which jerks a joint"

    def _judge_speed(self, seen: DriveSample) -> None:
        """As the drive says it, and as its position goes: units that were misread show here."""
        self._way.append((seen.stamp_ns, seen.position))
        while self._way[-1][0] - self._way[0][0] > SPEED_S * 1e9 and len(self._way) > 2:
            self._way.popleft()
        (first_ns, was), (last_ns, now) = self._way[0], self._way[-1]
        speed = abs(now - was) * 1e9 / (last_ns - first_ns) if last_ns - first_ns > 0.5e9 * SPEED_S else 0.0
        speed = max(speed, abs(seen.velocity or 0.0))
        if speed > self._plan.limits.speed:
            raise RunEnded(
                f"the joint moves at {math.degrees(speed):.3g}°/s, beyond its limit of "
                f"{math.degrees(self._plan.limits.speed):.3g}°/s (--max-speed){self._jerk()}"
            )

    # Afterwards, without power.

    def _restore(self) -> str | None:
        """Return all parameters as they were before, read back."""
        before, description = self._plan.parameters, self._power.node.description
        offset = self._power.drive.settings.axis * AXIS_OFFSET

        def restore(sdo: SdoChannel) -> Mapping[str, parameters.Change]:
            left = parameters.changed(before, parameters.read(sdo, description, offset, always))
            if left:
                parameters.put_back(sdo, description, before, iter(left))
                left = parameters.changed(before, parameters.read(sdo, description, offset, always))
            return left

        left = self._asked(lambda: self._power.node.run(restore), READ_S)
        if left is None:
            return "its parameters could not be read again: nobody knows whether they are as before"
        self.restored = not left
        words = ", ".join(f"{name} was {was}, is {now}" for name, (was, now) in left.items())
        return f"not all is as before: {words}" if left else None

    def finish(self) -> None:
        """Let go of what it listened to."""
        self._watch.close()
