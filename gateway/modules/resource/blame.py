"""The blame module: watches the control loop's frames and names who ran where one came late.

It watches only while somebody asks. Frames are seen in the bus's thread; looks at the computer's threads are
taken in the loop, one a frame and at most one each `LOOK_S`.
"""

import time
from collections import deque
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING, cast

from gateway.handlers import Handlers, on
from gateway.modules.resource.overruns import NOTHING, Blame, Deadline, Judge, Late
from gateway.modules.resource.tasks import TICK_NS, Id, Look, Tasks
from gateway.wire.framing import ErrorKind, refuse
from gateway.wire.method import Params
from gateway.wire.resource import RESOURCE_OVERRUNS, Overrun, Overruns, RanInstead

if TYPE_CHECKING:
    from drivers.bus.bus import CanBus
    from gateway.connections.session import Session
    from gateway.modules.component.module import ComponentModule
    from gateway.registry import Context

LOOK_S = 0.01
MEET_S, LATE_MEET_S = 1.0, 0.1  # how often new threads are looked for, at most; also for a late frame
KEPT = 256  # overruns that nobody has fetched
LOOKED_AT, NAMED = 20, 5  # processes an overrun


class BlameModule:
    """Overruns of the control loop."""

    def __init__(self, context: "Context") -> None:
        self._settings = context.config.control_loop
        self._loop = context.loop
        self._component = cast("ComponentModule", context.needs["component"])
        self._frames: deque[int] = deque()
        self._told: dict[Session, int] = {}  # how many overruns it has been told of
        self._overruns: deque[Overrun] = deque(maxlen=KEPT)
        self._count = 0  # overruns so far
        self._judge = Judge()
        self._tasks = Tasks()
        self._control: Mapping[int, str] = {}  # its processes
        self._bus: CanBus | None = None
        self._stopped = False
        self._cycles = 0  # since the last look
        self._looked_ns = self._met_ns = 0
        self.handlers = Handlers(on(RESOURCE_OVERRUNS, self._answer))

    def start(self) -> None:
        settings = self._settings
        if settings is None or settings.bus is None or settings.period_ms is None:
            return  # nothing to watch, and who asks is told so
        self._deadline = Deadline(round(settings.period_ms * 1e6), round(settings.tolerance_ms * 1e6))
        self._since_ns = time.monotonic_ns()
        self._tasks.meet()
        self._look: Look = self._tasks.look()
        self._bus = self._component.robot.buses[settings.bus]
        self._bus.subscribe(settings.can_id, self._came)

    def stop(self) -> None:
        if self._bus is not None and self._settings is not None:
            self._bus.unsubscribe(self._settings.can_id, self._came)
        self._stopped = True
        self._loop.post(self._tasks.close)  # there it may be looking now

    # In the bus's thread, never for long.

    def _came(self, stamp_ns: int, _data: bytes) -> None:
        self._frames.append(stamp_ns)
        if len(self._frames) == 1:
            self._loop.post(self._follow)

    # In the loop.

    def _follow(self) -> None:
        late = []
        while self._frames:
            self._cycles += 1
            found = self._deadline.met(self._frames.popleft())
            late += [] if found is None else [found]
        now_ns = time.monotonic_ns()
        if self._stopped or (not late and now_ns - self._looked_ns < LOOK_S * 1e9):
            return
        before, looked_ns, new = self._look, self._looked_ns, self._meet(now_ns, because_late=bool(late))
        self._look, self._looked_ns = self._tasks.look(), now_ns
        cycles, self._cycles = self._cycles, 0
        if late:
            before = before | self._older(new, looked_ns)
            worst = max(late, key=lambda one: one.late_ns)
            self._put_down(worst, self._judge.late(worst, cycles, before, self._look, self._control))
        else:
            self._judge.in_time(cycles, before, self._look, self._control)

    def _meet(self, now_ns: int, *, because_late: bool) -> Collection[Id]:
        if now_ns - self._met_ns < 1e9 * (LATE_MEET_S if because_late else MEET_S):
            return ()
        self._met_ns = now_ns
        new = self._tasks.meet()
        if self._settings is not None:
            self._control = self._tasks.named(self._settings.processes)
        return new

    def _older(self, new: Collection[Id], looked_ns: int) -> Look:
        """Return new threads that began before the last measurement: their earlier use is not new."""
        booted_ns = time.clock_gettime_ns(time.CLOCK_BOOTTIME) - time.monotonic_ns()
        found: Look = {}
        for task in new:
            schedule = self._tasks.schedule(task)
            if schedule is None or schedule.started_ns + TICK_NS < looked_ns + booted_ns:
                found[task] = self._look.get(task, NOTHING)
        return found

    def _put_down(self, late: Late, blame: Blame) -> None:
        self._count += 1
        self._overruns.append(
            Overrun(
                stamp_ns=late.stamp_ns,
                late_ms=_ms(late.late_ns),
                reason=blame.reason.value,
                ran_ms=_ms(blame.own.ran_ns),
                waited_ms=_ms(blame.own.waited_ns),
                instead=self._named(blame),
            )
        )

    def _named(self, blame: Blame) -> list[RanInstead]:
        """Return the processes on the control loop's cores; those that it cannot preempt come first."""
        cores = {core for pid in self._control for core in self._tasks.cores(pid)}
        own = [self._tasks.schedule((pid, tid)) for pid in self._control for tid in self._tasks.threads(pid)]
        urgency = max((one.urgency for one in own if one is not None), default=0)
        ahead: list[RanInstead] = []
        behind: list[RanInstead] = []
        for pid, tid, ran_ns in blame.others[:LOOKED_AT]:
            schedule = self._tasks.schedule((pid, tid))
            if schedule is not None and (not cores or schedule.core in cores):
                name, thread = self._tasks.name(pid), self._tasks.name(pid, tid)
                ran = RanInstead(
                    pid, name, thread, _ms(ran_ns), schedule.core, schedule.policy, schedule.priority
                )
                (ahead if schedule.urgency >= urgency else behind).append(ran)
        return [*ahead, *behind][:NAMED]

    def _answer(self, session: "Session", _params: Params) -> Overruns:
        if self._bus is None:
            raise refuse(
                ErrorKind.UNAVAILABLE,
                "the robot's file does not say when its control loop is late: [control_loop] bus, period_ms",
            )
        told = self._told.get(session)
        if told is None and not session.closed:
            session.on_close(lambda: self._forget(session))
        new = min(self._count - (told or 0), len(self._overruns))
        self._told[session] = self._count
        return Overruns(
            watching_since_ns=self._since_ns,
            control={str(pid): name for pid, name in self._control.items()},
            cycles=self._deadline.cycles,
            missed=self._deadline.missed,
            overruns=list(self._overruns)[len(self._overruns) - new :],
        )

    def _forget(self, session: "Session") -> None:
        self._told.pop(session, None)


def _ms(ns: int) -> float:
    return round(ns / 1e6, 3)
