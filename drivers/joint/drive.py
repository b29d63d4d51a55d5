"""A joint: one axis of a CiA 402 drive as a component with channels in SI units.

Everything about the drive is read from the drive when it comes up: its PDO mapping, its ratings, what it does
on quick stop. What no TPDO brings is polled by SDO.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial

from drivers.bus.bus import CanBus
from drivers.bus.channels import Chosen, ObjectChannels, channels_of
from drivers.bus.frame_losses import FrameLosses
from drivers.bus.frames import EXTENDED, FrameHandler
from drivers.bus.lengths import Lengths
from drivers.bus.node import shared_node
from drivers.bus.sdo.channel import SdoChannel
from drivers.bus.values import Number, decode
from drivers.component import ComponentKind
from drivers.error_codes import error_text
from drivers.errors import DeviceAbort, Mismatch
from drivers.freshness import Freshness
from drivers.joint.cia402 import STATE_BITS, STATE_OF, DriveState
from drivers.joint.decoder import Decoder
from drivers.joint.plan import QuantitySource, ReadPlan, make_plan
from drivers.joint.power import PowerDrive
from drivers.joint.quantities import POSITION, STATE, STATUSWORD, Quantity, channels, quantities
from drivers.joint.reading import DriveReading, read_drive
from drivers.joint.remap import free_tpdos, mappable, remap
from drivers.joint.scaling import rated_torque
from drivers.joint.settings import JointSettings
from drivers.joint.stop_rpdo import find_stop_rpdo
from drivers.joint.supervision import JointWatch
from drivers.latest import Latest
from drivers.samples import Channel, ComponentState, Finding, Quality
from eds import Description

_IN_FAULT = (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE)


class JointDrive(PowerDrive):
    """One joint by its name in the robot's file."""

    kind = ComponentKind.JOINT

    def __init__(
        self,
        name: str,
        settings: JointSettings,
        bus: CanBus,
        description: Description,
        chosen: Chosen | None = None,
    ) -> None:
        """`chosen` are further objects of its node that are channels.

        Raises `EdsError` where the file describes no such axis, `SettingsError` on a contradiction.
        """
        super().__init__(shared_node(bus, settings.node_id, description, settings), settings)
        self.name = name
        chosen = chosen or {}
        found = quantities(description, settings.axis)
        self._quantities = tuple(one for one in found if one.name not in chosen)
        own = channels(name, self._quantities)
        self.channels: tuple[Channel, ...] = (*own, *channels_of(name, chosen))
        self.latest = Latest(name, self.channels, settings.stale_after_s)
        self._objects = ObjectChannels(self.node, description, chosen, self.latest, first=len(own))
        self.reading: DriveReading | None = None  # what the drive said about itself when it came up
        self.frames = 0
        self.short_frames = 0  # or longer: nothing was made of them
        self._description = description
        self._index = {channel.quantity: index for index, channel in enumerate(self.channels)}
        self._freshness = Freshness(settings.stale_after_s, settings.lost_after_s)
        self._watch = JointWatch(self.latest, bus.standstill, description)
        self._arrivals = FrameLosses()
        self._plan: ReadPlan | None = None
        self._started = False
        self._lock = threading.RLock()  # the plan and its undoing; values come from two threads
        self._undo: list[Callable[[], None]] = []

    def start(self) -> None:
        """Open the bus if nobody else has, and read the drive as soon as it answers."""
        with self._lock:
            if self._started:
                return
            self._started = True
        self._freshness.reset()
        self.node.attach(self, self.name)
        self.node.bus.hold(self._watch)

    def stop(self) -> None:
        """Let go of everything; what it does to the drive is nothing."""
        with self._lock:
            if not self._started:
                return
            self._started = False
        self.node.bus.release(self._watch)
        self.node.detach(self)
        self.forget()

    @property
    def synchronous(self) -> frozenset[str]:
        """The quantities that come by PDO with every SYNC, as it said when it came up."""
        plan = self._plan
        decoders = () if plan is None else plan.decoders
        every = [decoder for tpdo, decoder in decoders if tpdo.transmission_type == 1]
        return frozenset(self.channels[index].quantity for decoder in every for index in decoder.channels)

    def compare_with(self, other: "JointDrive") -> None:
        """Judge it against the same joint of the other leg too."""
        self._watch.compare_with(other.latest)

    def quality(self, now_ns: int) -> Quality:
        """Return the joint's trust in its position, and its problems in words."""
        state, age_ms = self._freshness.state(now_ns)
        problem = self.node.problem(now_ns)
        implausible: tuple[Finding, ...] = ()
        if not self.node.ready:
            state = ComponentState.LOST
        elif state is ComponentState.OK:
            implausible = self._watch.check.findings
            if self._drive_state(now_ns) in _IN_FAULT:
                state, problem = ComponentState.FAULT, self._fault_text(now_ns)
            elif implausible:
                state = ComponentState.FAULT
        else:
            problem = self._stood_still(now_ns, age_ms) or problem or self._silence_text(age_ms)
        findings = (*implausible, *self.node.trouble)
        objects = self._objects.problems(now_ns) if state is not ComponentState.LOST else ()
        notes = (*objects, *self._notes(now_ns, findings))
        texts = (problem, self._emcy_text(state, now_ns), *notes)
        words = "; ".join(text for text in texts if text)
        return Quality(state, age_ms, words or None, self.counters(), findings)

    def counters(self) -> dict[str, int]:
        """Since the driver was made."""
        return {
            "frames": self.frames,
            "short_frames": self.short_frames,
            "stale": self._freshness.stale,
            **self.node.counters(),
        }

    # What the node tells.

    def boot(self, sdo: SdoChannel) -> None:
        reading = read_drive(sdo, self._description, self.settings.axis)
        plan = make_plan(self.settings, self._quantities, reading)
        if self.settings.configure_pdos and (plan.position_from is None or not plan.position_from.cyclic):
            told = self._remap(sdo, reading, plan)
            reading = read_drive(sdo, self._description, self.settings.axis)
            plan = make_plan(self.settings, self._quantities, reading)
            plan = replace(plan, notes=(told, *plan.notes))
        stop_rpdo = find_stop_rpdo(self.node, sdo, self._offset)
        with self._lock:
            self.forget()
            if self._started:
                self.reading, self._plan, self._stop_rpdo = reading, plan, stop_rpdo
                self._watch.check.loaded.rated = rated_torque(self.settings, reading.scaling)
                self._install(plan)
                self._objects.install(reading.tpdos)

    def forget(self) -> None:
        with self._lock:
            while self._undo:
                self._undo.pop()()
            self._objects.forget()
            self.reading = self._plan = self._stop_rpdo = None
            self.latest.clear()
            self._watch.restart()
            self._freshness.disconnected()

    def _remap(self, sdo: SdoChannel, reading: DriveReading, plan: ReadPlan) -> str:
        """Bring what the channels need into free TPDOs; returns what came of it, in words."""
        if self.node.distrust is not None:
            return f"configure_pdos: {self.node.distrust}"
        free = list(free_tpdos(reading.tpdos, self.node.node_id, self.node.bus.unclaimed))
        if not free:
            return "configure_pdos: no TPDO of the drive is free, nothing was changed"
        more = mappable(self._description, (one.quantity for one in plan.polled_seldom))
        try:
            return remap(sdo, self._description, free, self._offset, list(more))
        except (DeviceAbort, Mismatch) as error:
            return f"configure_pdos: {error}"

    # How values come.

    def _install(self, plan: ReadPlan) -> None:
        bus = self.node.bus
        for tpdo, decoder in plan.decoders:
            can_id = tpdo.cob_id | EXTENDED if tpdo.extended else tpdo.cob_id
            handler = self._handler(decoder)
            bus.subscribe(can_id, handler)
            self._undo.append(partial(bus.unsubscribe, can_id, handler))
        if plan.position_from is not None and plan.position_from.cyclic:
            self._undo.append(self.node.follow(self._arrivals))
        for hz, polled in (
            (self.settings.poll_hz, plan.polled_often),
            (self.settings.slow_poll_hz, plan.polled_seldom),
        ):
            if hz and polled:
                self._undo.append(self.node.worker.repeat(1 / hz, partial(self._poll, deque(polled))))

    def _handler(self, decoder: Decoder) -> FrameHandler:
        """Return the handler of each frame of a TPDO: the hot path."""
        indices, values = decoder.channels, decoder.values
        update, lock = self.latest.update, self._lock
        position = self._index[POSITION] in indices
        arrived = self._arrivals.stamps.append
        lengths = Lengths(decoder.size, self.node.remapped)

        def on_frame(stamp_ns: int, data: bytes) -> None:
            if len(data) != lengths.usual and not lengths.fits(stamp_ns, len(data)):
                self.short_frames += 1
                return
            with lock:
                self.frames += 1
                update(stamp_ns, indices, values(data))
                if position:
                    self._freshness.seen(stamp_ns)
                    arrived(stamp_ns)

        return on_frame

    def _poll(self, polled: deque[QuantitySource], sdo: SdoChannel) -> None:
        """Ask for each; after one that is not answered the next turn begins with the others."""
        for _ in range(len(polled)):
            one, asked_ns = polled[0], time.monotonic_ns()
            polled.rotate(-1)
            try:
                data = sdo.upload(one.quantity.index, one.quantity.subindex, attempts=1)
            except DeviceAbort:
                continue  # its EDS knows it, this device does not: the others are there all the same
            counts = decode(data, self._type_of(one.quantity))
            if counts is not None and math.isfinite(counts):
                self._take(one, counts, asked_ns)

    def _type_of(self, quantity: Quantity) -> int:
        variable = self._description.variable(quantity.index, quantity.subindex)
        return 0 if variable is None else variable.data_type or 0

    def _take(self, one: QuantitySource, counts: Number, stamp_ns: int) -> None:
        """Take the answer, as old as the question: nobody knows how long it has waited."""
        indices: tuple[int, ...] = (one.channel,)
        values: tuple[float | None, ...] = (counts * one.linear.scale + one.linear.offset,)
        if one.quantity.name == STATUSWORD:
            indices = (*indices, self._index[STATE])
            values = (*values, STATE_OF[int(counts) & STATE_BITS])
        with self._lock:
            if self._plan is None or (self.latest.stamp_ns(one.channel) or 0) >= stamp_ns:
                return  # of another life of the drive, or older than what a TPDO has brought
            self.latest.update(stamp_ns, indices, values)
            if one.quantity.name == POSITION:
                self._freshness.seen(stamp_ns)

    # What is wrong, in words.

    def _notes(self, now_ns: int, findings: tuple[Finding, ...]) -> Iterator[str | None]:
        """Yield the notes on the joint; causes come before their consequences."""
        plan = self._plan
        yield self._watch.held_off.words
        yield from () if plan is None else plan.contradictions
        yield from self.node.findings
        yield from (one.text(now_ns) for one in findings)
        yield from () if plan is None else plan.notes

    def _fresh(self, quantity: str, now_ns: int) -> float | None:
        index = self._index.get(quantity)
        return None if index is None else self.latest.read(index, now_ns)[0]

    def _drive_state(self, now_ns: int) -> DriveState | None:
        value = self._fresh(STATE, now_ns)
        return None if value is None else DriveState(int(value))

    def _fault_text(self, now_ns: int) -> str:
        vendor = self._description.vendor_id
        emcy = self.node.life.active_emcy
        code = self._fresh("error_code", now_ns)
        if emcy is not None:
            return f"the drive is in fault: {emcy.text(vendor)}"
        if code:
            return f"the drive is in fault: {error_text(int(code), vendor)}"
        return "the drive is in fault and does not say why (no EMCY was seen, 603Fh is empty)"

    def _emcy_text(self, state: ComponentState, now_ns: int) -> str | None:
        """Return an emergency message of a drive that keeps working."""
        emcy = self.node.life.active_emcy
        if emcy is None or state is ComponentState.LOST or self._drive_state(now_ns) in _IN_FAULT:
            return None
        age_s = max(0, now_ns - emcy.stamp_ns) / 1e9
        return f"it reports {emcy.text(self._description.vendor_id)} ({age_s:.0f} s ago)"

    def _stood_still(self, now_ns: int, age_ms: float | None) -> str | None:
        since_ns = None if age_ms is None else now_ns - round(age_ms * 1e6)
        return self.node.bus.standstill.words(now_ns, since_ns, self.settings.stale_after_s)

    def _silence_text(self, age_ms: float | None) -> str:
        since = "no position has come yet" if age_ms is None else f"no position for {age_ms / 1000:.1f} s"
        tpdo = None if self._plan is None else self._plan.position_from
        if tpdo is None:
            return f"{since}: the drive does not answer the SDO that asks for it"
        return (
            f"{since}: TPDO{tpdo.number} (0x{tpdo.cob_id:03X}), which brings it {tpdo.trigger}, does not come"
        )
