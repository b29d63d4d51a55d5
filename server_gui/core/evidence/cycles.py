"""Telemetry cut into gait cycles by gait events, as it comes: what each joint did in each stride."""

import collections
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np
import numpy.typing as npt

from server_gui.core.evidence import measures
from server_gui.core.evidence.measures import CURVES, POINTS, Floats
from server_gui.core.processing.component import WIRINGS, Columns, ComponentProcessing
from server_gui.core.processing.gait_events import MAX_GAP_NS, Leg
from server_gui.core.processing.gait_measures import LONGEST_STRIDE_NS, Stride, symmetry_index
from server_gui.core.processing.wiring import FORCE, STATE, leg_of

ENABLED: Final = "operation enabled"  # the word of a drive's state in which it follows its target
WAIT_NS: Final = 200_000_000  # for what other components tell of the end of a stride
KEPT_NS: Final = LONGEST_STRIDE_NS + 2 * WAIT_NS + MAX_GAP_NS
COMPUTER_NS: Final = 6_000_000_000  # what was told of computer and bus longer ago is not known any more
MOSTLY: Final = 2 / 3  # of what models say within a stride
MOST: Final = 1e9  # in SI no joint and no foot has more: whatever sends it is broken
LABELS: Final = 1000  # more than they say of two strides
DRAWN: Final = ("position", "following_error", "current", "torque")  # curves that are kept, of 101 points


@dataclass(frozen=True, slots=True)
class Cycle:
    """One stride of one leg. `values` by `component.metric`, or by the metric's key where it is the robot's.

    `left_out` says why a joint of this leg has none. `activity` is None where none lasted for most of it.
    """

    leg: Leg
    began_ns: int
    ended_ns: int
    activity: str | None = ""
    values: Mapping[str, float] = field(default_factory=dict)
    left_out: Mapping[str, str] = field(default_factory=dict)
    curves: Mapping[str, npt.NDArray[np.float32]] = field(default_factory=dict)

    @property
    def seconds(self) -> float:
        return (self.ended_ns - self.began_ns) / 1e9


class CycleCutter:
    """Takes one robot's rows in the order of time, and gives each cycle once it is over.

    `enabled` has of each channel that is a drive's state the numbers that mean `ENABLED`.
    """

    def __init__(self) -> None:
        self.enabled: Mapping[str, frozenset[float]] = {}
        self._processing = ComponentProcessing()
        self.restart()

    def restart(self) -> None:
        """Forget what has come: another robot, or one whose clock has begun anew."""
        self._processing.restart()
        self._rings: dict[tuple[str, ...], _Ring] = {}
        self._waiting: collections.deque[Stride] = collections.deque()
        self._newest: dict[Leg, Stride] = {}
        self._newest_ns = 0
        self._told: dict[str, tuple[int, float]] = {}
        self._activities: collections.deque[tuple[int, str]] = collections.deque(maxlen=LABELS)

    def distrust(self, components: frozenset[str]) -> None:
        """Take no gait events and no values from these until told otherwise."""
        self._processing.distrusted = components

    def tell(self, key: str, value: float | None) -> None:
        """Take what is known of the robot's computer or bus as of now; None: nothing."""
        if value is None:
            self._told.pop(key, None)
        else:
            self._told[key] = self._newest_ns, value

    def label(self, stamp_ns: int, activity: str) -> None:
        """Take what a model says that the wearer does at an instant."""
        self._activities.append((stamp_ns, activity))

    def take(self, stamps_ns: Sequence[int], columns: Columns) -> list[Cycle]:
        """Take rows; the cycles that are over with them."""
        if not stamps_ns:
            return []
        self._waiting.extend(self._processing.take(stamps_ns, columns).strides)
        names = tuple(columns)
        if names not in self._rings:
            if len(self._rings) >= WIRINGS:
                self._rings.clear()
            self._rings[names] = _Ring(names)
        self._rings[names].take(stamps_ns, columns)
        self._newest_ns = stamps_ns[-1]
        return list(self._over())

    def _over(self) -> Iterator[Cycle]:
        while self._waiting and self._waiting[0].ended_ns + WAIT_NS <= self._newest_ns:
            stride = self._waiting.popleft()
            self._newest[stride.leg] = stride
            yield self._cycle(stride)

    def _cycle(self, stride: Stride) -> Cycle:
        joints, forces = self._curves(stride)
        values = self._of_robot(stride, forces)
        left_out: dict[str, str] = {}
        drawn: dict[str, npt.NDArray[np.float32]] = {}
        for joint, curves in joints.items():
            if (why := self._why_not(joint, curves)) is not None:
                left_out[joint] = why
                continue
            values |= {f"{joint}.{key}": one for key, one in measures.of_joint(curves, stride.time_s).items()}
            drawn |= {
                f"{joint}.{name}": curves[name][::2].astype(np.float32) for name in DRAWN if name in curves
            }
        activity = self._activity(stride)
        return Cycle(stride.leg, stride.began_ns, stride.ended_ns, activity, values, left_out, drawn)

    def _activity(self, stride: Stride) -> str | None:
        """Return what models said for most of the stride; empty where they said nothing."""
        said = [word for at_ns, word in self._activities if stride.began_ns <= at_ns <= stride.ended_ns]
        if not said:
            return ""
        (word, times), *_ = collections.Counter(said).most_common(1)
        return word if times >= MOSTLY * len(said) else None

    def _why_not(self, joint: str, curves: Mapping[str, Floats]) -> str | None:
        if joint in self._processing.distrusted:
            return "it reports a fault"
        if not any(name in curves for name in CURVES):
            return "values are missing"
        state = curves.get(STATE)
        if state is None:
            return None if f"{joint}.{STATE}" not in self.enabled else "the state of its drive is missing"
        wanted = self.enabled.get(f"{joint}.{STATE}", frozenset())
        return (
            None if all(one in wanted for one in np.unique(state).tolist()) else "its drive was not enabled"
        )

    def _of_robot(self, stride: Stride, forces: Mapping[Leg, Floats]) -> dict[str, float]:
        loads = {leg: float(force.mean()) for leg, force in forces.items()}
        left, right = self._newest.get(Leg.LEFT), self._newest.get(Leg.RIGHT)
        known: dict[str, float | None] = {
            "cadence": 120.0 / stride.time_s,
            "symmetry_load": symmetry_index(loads.get(Leg.LEFT), loads.get(Leg.RIGHT)),
        }
        if left and right and abs(left.ended_ns - right.ended_ns) <= LONGEST_STRIDE_NS:
            known["symmetry_stance"] = symmetry_index(left.stance, right.stance)
            known["symmetry_step"] = symmetry_index(left.step_s, right.step_s)
        fresh = {
            key: one for key, (at_ns, one) in self._told.items() if stride.ended_ns - at_ns <= COMPUTER_NS
        }
        return {key: one for key, one in (known | fresh).items() if one is not None}

    def _curves(self, stride: Stride) -> tuple[dict[str, dict[str, Floats]], dict[Leg, Floats]]:
        """Joints of the leg and of no leg: what is known over the whole stride; and both feet's force."""
        joints: dict[str, dict[str, Floats]] = {}
        forces: dict[Leg, Floats] = {}
        for ring in self._rings.values():
            found = ring.curves(stride)
            for joint in ring.joints:
                if leg_of(joint) in (stride.leg, None):
                    joints.setdefault(joint, {})
            for channel, curve in found.items():
                component, _, quantity = channel.rpartition(".")
                leg = leg_of(component)
                if quantity == FORCE and leg is not None:
                    forces[leg] = curve
                elif component in joints:
                    joints[component][quantity] = curve
        return joints, forces


class _Ring:
    """The newest rows of one set of columns."""

    def __init__(self, names: Sequence[str]) -> None:
        split = [(name, *name.rpartition(".")[::2]) for name in names]
        self.joints = tuple(component for _, component, quantity in split if quantity == "position")
        wanted = (*CURVES, STATE)
        self._names = [
            name
            for name, component, quantity in split
            if (component in self.joints and quantity in wanted) or (quantity == FORCE and leg_of(component))
        ]
        self._states = {place for place, name in enumerate(self._names) if name.endswith(f".{STATE}")}
        self._parts: collections.deque[tuple[npt.NDArray[np.int64], Floats]] = collections.deque()

    def take(self, stamps_ns: Sequence[int], columns: Columns) -> None:
        if not self._names:
            return
        values = np.array([columns[name] for name in self._names], dtype=np.float64)  # None becomes NaN
        values[~(np.abs(values) < MOST)] = np.nan
        self._parts.append((np.asarray(stamps_ns, dtype=np.int64), values))
        while abs(stamps_ns[-1] - self._parts[0][0][-1]) > KEPT_NS:
            self._parts.popleft()

    def curves(self, stride: Stride) -> dict[str, Floats]:
        """Return the channels that are known all through this stride, evenly over it."""
        first_ns, last_ns = stride.began_ns - MAX_GAP_NS, stride.ended_ns + MAX_GAP_NS
        parts = [part for part in self._parts if part[0][-1] >= first_ns and part[0][0] <= last_ns]
        if not parts:
            return {}
        stamps_ns = np.concatenate([part[0] for part in parts])
        values = np.concatenate([part[1] for part in parts], axis=1)
        grid_ns = np.linspace(stride.began_ns, stride.ended_ns, POINTS)
        found = {}
        for place, name in enumerate(self._names):
            known = ~np.isnan(values[place])
            curve = _even(stamps_ns[known], values[place, known], grid_ns, steps=place in self._states)
            if curve is not None:
                found[name] = curve
        return found


def _even(stamps_ns: npt.NDArray[np.int64], values: Floats, grid_ns: Floats, *, steps: bool) -> Floats | None:
    """Return the values at the grid's instants; None where they are too far apart.

    A state is not interpolated.
    """
    first = int(np.searchsorted(stamps_ns, grid_ns[0], "right")) - 1
    last = int(np.searchsorted(stamps_ns, grid_ns[-1], "left"))
    if first < 0 or last >= len(stamps_ns) or np.diff(stamps_ns[first : last + 1]).max() > MAX_GAP_NS:
        return None
    if steps:
        return np.asarray(values[first : last + 1])
    began_ns = stamps_ns[first]
    known = slice(first, last + 1)
    return np.asarray(np.interp(grid_ns - began_ns, stamps_ns[known] - began_ns, values[known]))
