"""Components and their channels: described, and their newest values."""

from msgspec import UNSET, Struct, UnsetType

from gateway.wire.finding import FindingInfo
from gateway.wire.method import Globs, Method, Params
from gateway.wire.role import Role

QualityInfo = dict[str, str | int | float | None]  # state, age_ms, problem, and the component's own counters


class LayoutInfo(Struct, frozen=True):
    """Positions of an insole's cells as worn: [x, y, area] of `cell_0`, `cell_1` …, in m and m².

    x is forward from the rear edge of the heel, y to the left from the foot's centre line.
    """

    name: str
    cells: list[tuple[float, float, float]]


class EmcyInfo(Struct, frozen=True):
    """The last emergency message (EMCY) of a component's device."""

    stamp_ns: int
    code: int
    words: str  # code, meaning, and the error register's bits
    active: bool  # not taken back


class AngleInfo(Struct, frozen=True):
    """Conversion of a joint's counts to its angle (rad): `rad_per_count` · counts + `zero_offset`.

    `rad_per_count` is negative where counts fall when the joint bends.
    """

    rad_per_count: float
    zero_offset: float


class ComponentInfo(Struct, frozen=True):
    """One component of `robot.describe`; `problem` says in words what is wrong."""

    name: str
    kind: str
    state: str
    problem: str | None = None
    device: dict[str, str | int] | UnsetType = UNSET  # what its EDS says, where it is on which bus
    layout: LayoutInfo | UnsetType = UNSET  # of an insole
    findings: list[FindingInfo] | UnsetType = UNSET  # of what `problem` says, that which has a beginning
    emcy: EmcyInfo | UnsetType = UNSET
    angle: AngleInfo | UnsetType = UNSET  # of a joint
    calibration: str | UnsetType = UNSET  # of an insole or IMU: file and digest; empty: it has none


class ChannelInfo(Struct, frozen=True):
    """One channel of `robot.describe`; `enum` gives a state's numbers their words."""

    name: str
    unit: str
    component: str
    quantity: str
    enum: dict[str, str] | UnsetType = UNSET


class SnapshotParams(Params, frozen=True):
    """`component.snapshot`; `channels` are globs such as `left_*.position`, none means all."""

    channels: Globs | None = None


class Snapshot(Struct, frozen=True):
    """Result of `component.snapshot` and `status.snapshot`."""

    stamp_ns: int
    values: dict[str, float | None]
    stamps_ns: dict[str, int | None]
    quality: dict[str, QualityInfo]


COMPONENT_SNAPSHOT = Method(
    "component.snapshot", SnapshotParams, Snapshot, module="component", role=Role.VIEWER
)
STATUS_SNAPSHOT = Method("status.snapshot", Params, Snapshot, module="status", in_turn=True, role=Role.VIEWER)
METHODS = (COMPONENT_SNAPSHOT, STATUS_SNAPSHOT)
