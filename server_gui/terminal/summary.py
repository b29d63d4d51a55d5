"""Summary of a run: did the joints move, did the feet alternate, was anything lost."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from gateway.client import Batch

MOVED_RAD = 0.02  # a joint at rest moves less than this
LOADED_N = 50.0  # a foot that carries less is taken to be in the air
CARRIES = 0.7  # of both feet's force: then this foot stands


@dataclass(slots=True)
class Range:
    """The smallest and the largest value seen."""

    low: float | None = None
    high: float | None = None

    def take(self, value: float) -> None:
        self.low = value if self.low is None else min(self.low, value)
        self.high = value if self.high is None else max(self.high, value)

    @property
    def span(self) -> float:
        """High minus low, 0 while nothing was seen."""
        return 0.0 if self.low is None or self.high is None else self.high - self.low


@dataclass(slots=True)
class Foot:
    """Load statistics of one foot."""

    rows: int = 0
    loaded: int = 0

    def take(self, force_n: float) -> None:
        self.rows += 1
        self.loaded += force_n > LOADED_N

    @property
    def loaded_share(self) -> float | None:
        """Share of the rows in which the foot was loaded, None without any."""
        return self.loaded / self.rows if self.rows else None


@dataclass(slots=True)
class Summary:
    """Adds up batches. `joints` and `feet` are component names; two feet alternate, others do not."""

    joints: dict[str, Range]
    feet: dict[str, Foot]
    rows: int = 0
    alternations: int = 0  # times that the weight went over to the other foot
    worst: dict[str, str] = field(default_factory=dict)  # component → the worst state it was in
    _standing: str | None = None

    @classmethod
    def of(cls, joints: Iterable[str], feet: Iterable[str]) -> "Summary":
        """Return an empty one for these components."""
        return cls({name: Range() for name in joints}, {name: Foot() for name in feet})

    def take(self, batch: Batch) -> None:
        """Add a batch; missing values count for nothing."""
        self.rows += len(batch.stamps_ns)
        for name, seen in self.joints.items():
            for value in _values(batch, f"{name}.position"):
                seen.take(value)
        for name, foot in self.feet.items():
            for value in _values(batch, f"{name}.force"):
                foot.take(value)
        if len(self.feet) == 2:
            self._walk(batch, *self.feet)

    def see(self, component: str, state: str) -> None:
        """Note a component's state; the worst is kept."""
        self.worst[component] = max(self.worst.get(component, state), state, key=_severity)

    def failures(self) -> list[str]:
        """Return why the run was no walk that can be believed, in words; empty if it was one."""
        still = [name for name, seen in self.joints.items() if seen.span < MOVED_RAD]
        lost = [name for name, state in self.worst.items() if state == "lost"]
        return [
            *(["no joint was seen"] if not self.joints else []),
            *([f"did not move: {', '.join(still)}"] if still else []),
            *(["the feet did not alternate"] if self.alternations < 2 else []),
            *([f"lost: {', '.join(lost)}"] if lost else []),
        ]

    def _walk(self, batch: Batch, left: str, right: str) -> None:
        columns = (batch.columns.get(f"{foot}.force", []) for foot in (left, right))
        for left_n, right_n in zip(*columns, strict=False):
            standing = _standing(left_n, right_n, left, right)
            if standing is not None:
                self.alternations += self._standing not in (None, standing)
                self._standing = standing


def _severity(state: str) -> int:
    order = ("ok", "stale", "fault", "lost")
    return order.index(state) if state in order else len(order)


def _values(batch: Batch, channel: str) -> list[float]:
    return [value for value in batch.columns.get(channel, ()) if value is not None]


def _standing(left_n: float | None, right_n: float | None, left: str, right: str) -> str | None:
    """Return the foot that carries nearly all of the weight, if one does."""
    if left_n is None or right_n is None or left_n + right_n < LOADED_N:
        return None
    share = left_n / (left_n + right_n)
    if share >= CARRIES:
        return left
    return right if share <= 1.0 - CARRIES else None
