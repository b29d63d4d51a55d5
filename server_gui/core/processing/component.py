"""Component-processing: a robot's samples become what is shown of its wearer and its joints."""

import collections
import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from server_gui.core.processing.foot_imu_events import FootImuEvents
from server_gui.core.processing.gait_events import MAX_GAP_NS, EventKind, EventSource, GaitEvent, Leg
from server_gui.core.processing.gait_measures import Gait, GaitMeasures, Stride
from server_gui.core.processing.joint_measures import Extremes
from server_gui.core.processing.kinematic_events import KinematicEvents
from server_gui.core.processing.pressure_events import PressureEvents
from server_gui.core.processing.wiring import TRUNK, Wiring, leg_of

EVENTS = 64  # the newest that are kept
WIRINGS = 64  # sets of columns that are known at a time; a stream of samples has one a component
SILENT_NS = 500_000_000  # a source that told nothing for so long leaves its leg to the next best

Columns = Mapping[str, Sequence[float | None]]


class GaitFindings(NamedTuple):
    """Findings in some rows."""

    events: list[GaitEvent]
    strides: list[Stride]


@dataclass(frozen=True, slots=True)
class Derived:
    """Values derived from a robot's samples, as of now: times and angles in SI units."""

    stamp_ns: int = 0  # the newest row, on the robot's clock
    gait: Gait = field(default_factory=Gait)
    sources: Mapping[Leg, EventSource | None] = field(default_factory=dict)  # what gives each leg's events
    events: tuple[GaitEvent, ...] = ()  # the newest, oldest first


class ComponentProcessing:
    """Takes rows in the order of time, live or from a recording, and keeps what is derived from them.

    Each leg's events come from its insole where that tells something, else from an IMU on its foot, else from
    hips and knees; after a change of the source the first event counts as one after a gap. A component that
    is not trusted gives no events.
    """

    def __init__(self) -> None:
        self.distrusted: frozenset[str] = frozenset()  # components that say themselves that they are wrong
        self.restart()

    def restart(self) -> None:
        """Forget everything: another robot, or one whose clock has begun anew."""
        self._pressure = {leg: PressureEvents(leg) for leg in Leg}
        self._foot_imu = {leg: FootImuEvents(leg) for leg in Leg}
        self._kinematics = KinematicEvents()
        self._heard_ns: dict[tuple[Leg, EventSource], int] = {}
        self._source: dict[Leg, EventSource] = {}
        self._angles = [0.0] * (TRUNK + 1)  # left hip and knee, right hip and knee, trunk: the newest of each
        self._angles_ns = [0] * TRUNK  # when each of the joints' was taken; 0: never
        self._measures = GaitMeasures()
        self._ranges: dict[str, Extremes] = {}
        self._events: collections.deque[GaitEvent] = collections.deque(maxlen=EVENTS)
        self._wirings: dict[tuple[str, ...], Wiring] = {}
        self._stamp_ns = 0

    def take(self, stamps_ns: Sequence[int], columns: Columns) -> GaitFindings:
        """Rows as a batch of a stream has them."""
        wiring = self._wiring(tuple(columns))
        taken = GaitFindings([], [])
        for row, stamp_ns in enumerate(stamps_ns):
            self._stamp_ns = stamp_ns
            self._measures.see(stamp_ns)
            self._joints(wiring, row, columns)
            for event in self._found(wiring, stamp_ns, row, columns):
                taken.events.append(event)
                stride = self._event(event)
                if stride is not None:
                    taken.strides.append(stride)
        return taken

    def shown(self, now_ns: int | None = None) -> Derived:
        """Return the derived values at `now_ns` on the robot's clock; by default at the newest row."""
        now_ns = self._stamp_ns if now_ns is None else now_ns
        return Derived(
            stamp_ns=self._stamp_ns,
            gait=self._measures.now(now_ns),
            sources={leg: self._best(leg, now_ns) for leg in Leg},
            events=tuple(self._events),
        )

    # --- gait

    def _found(self, wiring: Wiring, stamp_ns: int, row: int, columns: Columns) -> list[GaitEvent]:
        """Return the events of every source; only those of each leg's best source count."""
        found: list[GaitEvent] = []
        for detectors, source, fed in (
            (self._pressure, EventSource.PRESSURE, wiring.forces),
            (self._foot_imu, EventSource.FOOT_IMU, wiring.pitch_rates),
        ):
            for leg, (channel, component) in fed:
                value = columns[channel][row]
                if value is None or component in self.distrusted:
                    continue
                self._heard_ns[leg, source] = stamp_ns
                event = detectors[leg].feed(stamp_ns, value)
                if event is not None and self._best(leg, stamp_ns) is source:
                    found.append(self._continued(event, source))
        if wiring.angles:
            found += [
                self._continued(event, EventSource.KINEMATICS)
                for event in self._by_joints(wiring, stamp_ns, row, columns)
                if self._best(event.leg, stamp_ns) is EventSource.KINEMATICS
            ]
        return found

    def _by_joints(self, wiring: Wiring, stamp_ns: int, row: int, columns: Columns) -> list[GaitEvent]:
        angles = self._angles
        for place, channel in wiring.angles:
            value = columns[channel][row]
            if value is not None:
                angles[place] = value
                if place < TRUNK:
                    self._angles_ns[place] = stamp_ns
            elif place == TRUNK:
                angles[place] = 0.0
        if stamp_ns - min(self._angles_ns) > MAX_GAP_NS:
            return []
        self._heard_ns[Leg.LEFT, EventSource.KINEMATICS] = self._heard_ns[
            Leg.RIGHT, EventSource.KINEMATICS
        ] = stamp_ns
        left_hip, left_knee, right_hip, right_knee, trunk = angles
        return self._kinematics.feed(stamp_ns, (left_hip, left_knee), (right_hip, right_knee), trunk)

    def _best(self, leg: Leg, now_ns: int) -> EventSource | None:
        for source in EventSource:
            heard_ns = self._heard_ns.get((leg, source))
            if heard_ns is not None and abs(now_ns - heard_ns) <= SILENT_NS:
                return source
        return None

    def _continued(self, event: GaitEvent, source: EventSource) -> GaitEvent:
        before = self._source.get(event.leg)
        self._source[event.leg] = source
        return event if before is source else dataclasses.replace(event, after_gap=True)

    def _event(self, event: GaitEvent) -> Stride | None:
        self._events.append(event)
        if event.kind is EventKind.TOE_OFF:
            return self._measures.take(event)
        ranges = {name: seen.end() for name, seen in self._ranges.items() if leg_of(name) is event.leg}
        known = {name: moved for name, moved in ranges.items() if moved is not None}
        return self._measures.take(event, known)

    # --- joints

    def _joints(self, wiring: Wiring, row: int, columns: Columns) -> None:
        for channel, joint in wiring.positions:
            value = columns[channel][row]
            if value is not None:
                self._ranges[joint].take(value)

    # --- wiring

    def _wiring(self, channels: tuple[str, ...]) -> Wiring:
        wiring = self._wirings.get(channels)
        if wiring is None:
            if len(self._wirings) >= WIRINGS:
                self._wirings.clear()
            wiring = self._wirings[channels] = Wiring.of(channels)
            for _, joint in wiring.positions:
                self._ranges.setdefault(joint, Extremes())
        return wiring
