"""A trunk inclinometer on a CANopen bus (CiA 410): two slopes, by TPDO or polled, become the trunk's tilt."""

import threading
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from drivers.bus.bus import CanBus
from drivers.bus.frames import EXTENDED, FrameHandler
from drivers.bus.node import shared_node
from drivers.bus.pdo import Tpdo
from drivers.bus.sdo.channel import SdoChannel
from drivers.errors import SettingsError
from drivers.frame_shares import beside
from drivers.imu import slopes
from drivers.imu.canopen.cia410 import InclinometerSettings
from drivers.imu.conventions import Conventions
from drivers.imu.motion import TILT
from drivers.imu.slopes import MappedSlope, SlopePlan
from drivers.imu.trunk import TrunkImu
from drivers.samples import ComponentState, Quality
from eds import Description


class Inclinometer(TrunkImu):
    """A two-axis inclinometer by its name in the robot's file (a `Component`)."""

    channel_count = len(TILT)  # it feels nothing else

    def __init__(
        self,
        name: str,
        settings: InclinometerSettings,
        bus: CanBus,
        description: Description,
        beside: Path | None = None,
    ) -> None:
        """Build it; raises `SettingsError` also for a file with one axis only, or a wrongly shared node."""
        super().__init__(name, settings, Conventions(), "device", beside)
        if not slopes.has_two_axes(description):
            raise SettingsError(
                f"[imu.{name}] eds: {description.path.name} has no longitudinal and lateral slope "
                "(6010h and 6020h, or 6110h and 6120h): a trunk's tilt needs a two-axis inclinometer"
            )
        self.settings = settings
        self.node = shared_node(bus, settings.node_id, description, settings.times)
        self._description = description
        self._stale_ns = round(settings.stale_after_s * 1e9)
        self._slopes: list[tuple[int, float] | None] = [None, None]  # each with its stamp
        self._plan: SlopePlan | None = None
        self._started = False
        self._lock = threading.RLock()  # the plan and its undoing; slopes come from two threads
        self._undo: list[Callable[[], None]] = []
        self._frames = self._short_frames = 0

    def start(self) -> None:
        with self._lock:
            if self._started:
                return
            self._started = True
        self._freshness.reset()
        self.node.attach(self, self.name)

    def stop(self) -> None:
        with self._lock:
            self._started = False
        self.node.detach(self)
        self.forget()

    def quality(self, now_ns: int) -> Quality:
        node = self.node
        counters = {"frames": self._frames, "short_frames": self._short_frames, **node.counters()}
        known = self._quality(now_ns, node.problem(now_ns) or self._silence(), counters)
        known = beside(known, node.trouble, now_ns)
        notes = (*node.findings, *(self._plan.notes if self._plan is not None else ()))
        words = "; ".join(text for text in (known.problem, *notes) if text)
        state = known.state if node.ready else ComponentState.LOST
        return replace(known, state=state, problem=words or None)

    # What the node tells.

    def boot(self, sdo: SdoChannel) -> None:
        plan = slopes.make_plan(sdo, self._description, self.settings.poll_hz)
        with self._lock:
            self.forget()
            if self._started:
                self._plan = plan
                self._install(plan)

    def forget(self) -> None:
        with self._lock:
            while self._undo:
                self._undo.pop()()
            self._plan = None
            self._slopes = [None, None]
            self._forget()

    # How slopes come.

    def _install(self, plan: SlopePlan) -> None:
        bus = self.node.bus
        for tpdo, places in plan.tpdos:
            can_id = tpdo.cob_id | EXTENDED if tpdo.extended else tpdo.cob_id
            handler = self._handler(plan, tpdo, places)
            bus.subscribe(can_id, handler)
            self._undo.append(partial(bus.unsubscribe, can_id, handler))
        if plan.polled and self.settings.poll_hz:
            poll = partial(self._poll, plan)
            self._undo.append(self.node.worker.repeat(1 / self.settings.poll_hz, poll))

    def _handler(self, plan: SlopePlan, tpdo: Tpdo, places: tuple[MappedSlope, ...]) -> FrameHandler:
        def on_frame(stamp_ns: int, data: bytes) -> None:
            if len(data) < tpdo.size:
                self._short_frames += 1
                return
            counts = {place.axis: place.counts(data) for place in places}
            self._received(plan, stamp_ns, counts)

        return on_frame

    def _poll(self, plan: SlopePlan, sdo: SdoChannel) -> None:
        size = plan.pair.bits // 8
        answers = [sdo.upload(index, 0, attempts=1)[:size] for index in plan.pair.objects]
        counts = {axis: int.from_bytes(data, "little", signed=True) for axis, data in enumerate(answers)}
        self._received(plan, time.monotonic_ns(), counts)

    def _received(self, plan: SlopePlan, stamp_ns: int, counts: dict[int, int]) -> None:
        """Take slopes in counts; with both present, make a frame."""
        with self._lock:
            if self._plan is not plan:
                return
            self._frames += 1
            for axis, number in counts.items():
                self._slopes[axis] = (stamp_ns, number * plan.radians_per_count)
            longitudinal, lateral = self._slopes
            if longitudinal is None or lateral is None:
                return
            if stamp_ns - min(longitudinal[0], lateral[0]) <= self._stale_ns:
                self._take(slopes.frame(longitudinal[1], lateral[1], self.settings.directions), stamp_ns)

    def _silence(self) -> str | None:
        if self._plan is None:
            return None
        brought = ", ".join(f"TPDO{tpdo.number} (0x{tpdo.cob_id:03X})" for tpdo, _ in self._plan.tpdos)
        if self._plan.polled:
            return "no slope has come: the device does not answer the SDO that asks for it"
        return f"no slope comes: {brought}, which brings them, stays silent"
