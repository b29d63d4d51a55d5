"""The doctor's verdicts: a finding with figures and remedies, or a lack of data."""

import json
from dataclasses import dataclass

from gateway.config.robot import header

Plain = str | float | int | list[str]


@dataclass(frozen=True, slots=True)
class Edit:
    """A line of the robot's file."""

    kind: str  # joint, device, insole, imu, can
    name: str
    key: str
    value: Plain
    was: Plain | None  # None: the key is not in the file

    @property
    def words(self) -> str:
        before = "" if self.was is None else f"   # was {_toml(self.was)}"
        return f"robot.toml: {header(self.kind, self.name)} {self.key} = {_toml(self.value)}{before}"


@dataclass(frozen=True, slots=True)
class Together:
    """Lines of the robot's file of which one without the other would be worse than none."""

    edits: tuple[Edit, ...]

    @property
    def words(self) -> str:
        return "\n          and ".join(edit.words for edit in self.edits)


# Written by the doctor itself: what watches a drive or limits it, and never what moves it or paces the bus.
SAFE = frozenset({0x1017, 0x6007, 0x605A, 0x6065, 0x6073})
BOUNDS = frozenset({0x6065, 0x6073})  # a wider one is for people to say


@dataclass(frozen=True, slots=True)
class Write:
    """An object of a device, through the gateway's own writes."""

    component: str
    index: int
    subindex: int
    value: int
    was: int | None = None
    scale: float = 1.0  # of the parameter that it is in the robot's file, in `unit`
    unit: str = ""
    is_released: bool = True  # by the robot's file, as the gateway says

    @property
    def is_safe(self) -> bool:
        """Whether it moves nothing, and allows no more than before."""
        index = self.index if self.index < 0x6000 else self.index % 0x800 + 0x6000
        return index in SAFE and not (index in BOUNDS and (self.was is None or self.value > self.was))

    @property
    def address(self) -> str:
        return f"{self.component}.0x{self.index:04X}:{self.subindex}"

    @property
    def words(self) -> str:
        before = "" if self.was is None else f"   # was {self._shown(self.was)}"
        counts = "" if self.scale == 1 else f"   ({self.value} of the device's own)"
        first = "" if self.is_released else self._first
        return f"SDO: gwrms set {self.address}={self._shown(self.value)}{self.unit}{before}{counts}{first}"

    @property
    def release(self) -> tuple[str, str]:
        """Lines of the robot's file that let it be written."""
        return (
            f'[parameter."{self.component}.object_{self.index:04x}"]',
            f'object = "0x{self.index:04X}:{self.subindex}"',
        )

    @property
    def _first(self) -> str:
        table, line = (f"\n              {one}" for one in self.release)
        return (
            f"\n          first add to robot.toml, which does not release it:{table}{line}"
            "\n          then start the gateway again, and stop first (gwrms stop): "
            "it is changed only while no drive may move"
        )

    def _shown(self, value: int) -> str:
        return str(value) if self.scale == 1 else f"{value * self.scale:.12g}"


@dataclass(frozen=True, slots=True)
class Run:
    """A command for a shell on the robot, as its administrator: shown, never run."""

    words: str


@dataclass(frozen=True, slots=True)
class Advice:
    """A remedy that only hands can carry out."""

    words: str


Fix = Edit | Together | Write | Run | Advice


@dataclass(frozen=True, slots=True)
class Finding:
    """A problem: where it is, its evidence and its fixes, the likeliest first."""

    rule: str
    about: str
    words: str
    evidence: tuple[str, ...]
    fixes: tuple[Fix, ...]


@dataclass(frozen=True, slots=True)
class Unknown:
    """A lack of data, with the reason: it is never reported as healthy."""

    rule: str
    about: str
    why: str


Verdict = Finding | Unknown


def _toml(value: Plain) -> str:
    return json.dumps(value, ensure_ascii=False)
