"""Life of a wearer's own model: the table of its states, and their reports.

One walk is learned from, tried beside the general model, offered, and taken back with a word. It belongs to a
`Context`: the wearer who is named, the recording, the robot's boot, its link and the model that serves.
Anything of that changes, and everything begins anew; the general model serves from then on.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import Enum
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:  # who only shows it has no registry of models
    from server_gui.core.prediction.model_loading import Model

GAIT_PHASE: Final = "gait_phase"  # the one task that is adapted
ADAPTED: Final = ".w"  # in an adapted model's id, between that of the general model and its own digits
LEARNED_S: Final = 60.0  # of steps
TRIED_S: Final = 20.0  # of steps that come after those

UNRECORDED: Final = "nothing is learned from a walk that is not recorded"


class AdaptationState(Enum):
    """State of the adaptation."""

    OFF = "off"
    UNNAMED = "unnamed"
    COLLECTING = "collecting"
    LEARNING = "learning"
    TRYING = "trying"
    OFFERED = "offered"
    SERVING = "serving"
    NO_BETTER = "no better"
    DECLINED = "declined"
    TAKEN_BACK = "taken back"
    FAILED = "failed"


class Happening(Enum):
    """Event of the adaptation, other than a change of context; those in capitals come from a person."""

    ENOUGH = "enough"
    LEARNED = "learned"
    BETTER = "better"
    NO_BETTER = "no better"
    BROKE = "broke"
    ACCEPT = "ACCEPT"
    DECLINE = "DECLINE"
    TAKE_BACK = "TAKE BACK"
    AGAIN = "AGAIN"


def _table(
    rows: dict[AdaptationState, dict[Happening, AdaptationState]],
) -> Mapping[AdaptationState, Mapping[Happening, AdaptationState]]:
    return MappingProxyType({state: MappingProxyType(row) for state, row in rows.items()})


ANEW: Final = {Happening.AGAIN: AdaptationState.COLLECTING}
# What is not in a row changes nothing.
NEXT: Final = _table(
    {
        AdaptationState.OFF: {},
        AdaptationState.UNNAMED: {},
        AdaptationState.COLLECTING: {
            Happening.ENOUGH: AdaptationState.LEARNING,
            Happening.BROKE: AdaptationState.FAILED,
        },
        AdaptationState.LEARNING: {
            Happening.LEARNED: AdaptationState.TRYING,
            Happening.BROKE: AdaptationState.FAILED,
        },
        AdaptationState.TRYING: {
            Happening.BETTER: AdaptationState.OFFERED,
            Happening.NO_BETTER: AdaptationState.NO_BETTER,
            Happening.BROKE: AdaptationState.FAILED,
        },
        AdaptationState.OFFERED: {
            Happening.ACCEPT: AdaptationState.SERVING,
            Happening.DECLINE: AdaptationState.DECLINED,
        },
        AdaptationState.SERVING: {
            Happening.TAKE_BACK: AdaptationState.TAKEN_BACK,
            Happening.BROKE: AdaptationState.FAILED,
        },
        AdaptationState.NO_BETTER: ANEW,
        AdaptationState.DECLINED: ANEW,
        AdaptationState.TAKEN_BACK: ANEW,
        AdaptationState.FAILED: ANEW,
    }
)
BY_PERSON: Final = (Happening.ACCEPT, Happening.DECLINE, Happening.TAKE_BACK, Happening.AGAIN)


@dataclass(frozen=True, slots=True)
class Wearing:
    """Wearer of a robot's recording; "" if nobody is named, or nothing is recorded."""

    session: str = ""
    wearer: str = ""


@dataclass(frozen=True, slots=True)
class Context:
    """Context of an adaptation. `model` is the general one, None if none serves.

    `links` counts how often the link came or went, `silences` how often nothing came for long. `bar` says why
    no unproven model may serve this robot.
    """

    wearing: Wearing
    boot_id: str | None
    links: int
    is_linked: bool
    model: "Model | None"
    bar: str = ""
    silences: int = 0

    @property
    def first(self) -> AdaptationState:
        """Where everything begins in it."""
        if self.model is None or not self.is_linked or self.why_off:
            return AdaptationState.OFF
        return AdaptationState.COLLECTING if self.wearing.wearer else AdaptationState.UNNAMED

    @property
    def why_off(self) -> str:
        """Why nothing is learned, where there is something to say of that."""
        if self.model is None or not self.is_linked:
            return ""
        return self.bar or ("" if self.wearing.session else UNRECORDED)


@dataclass(frozen=True, slots=True)
class Tried:
    """Both models on strides that neither has learned: RMS errors in % of the cycle."""

    before: float
    after: float
    strides: int
    missed: tuple[float, float] | None = None  # shares of the decisions: said, and off by over a tenth

    @property
    def text(self) -> str:
        """In few words."""
        return f"{self.before:.1f} → {self.after:.1f} %"

    @property
    def wrong(self) -> str:
        """Share of wrong predictions, in words; empty if unknown."""
        if self.missed is None:
            return ""
        before, after = (100.0 * each for each in self.missed)
        return f"off by more than a tenth of the stride: {before:.1f} → {after:.1f} % of the time"


@dataclass(frozen=True, slots=True)
class Adapting:
    """Progress of one robot's adaptation. `number` identifies the attempt, in a person's answers too."""

    robot: str
    number: int
    state: AdaptationState
    wearer: str = ""
    stepped_s: float = 0.0  # in this state
    tried: Tried | None = None
    why: str = ""
    model: str = ""  # the adapted one's id, while it serves
    since_s: float | None = field(default=None, compare=False)  # UTC, in this state

    @property
    def choices(self) -> tuple[Happening, ...]:
        """The possible decisions of a person."""
        return tuple(one for one in BY_PERSON if one in NEXT[self.state])

    @property
    def tip(self) -> str:
        """In words, and how often what was said was wrong."""
        wrong = "" if self.tried is None else self.tried.wrong
        return "\n".join(filter(None, (self.text, wrong)))

    @property
    def standing(self) -> str:
        """Whether a copy serves or is tried, for whom, since when, and how to end that; else empty."""
        whom = f"learned from {self.wearer}"
        since = "" if self.since_s is None else f" since {_time_of_day(self.since_s)}"
        worth = "" if self.tried is None else f" ({self.tried.text})"
        match self.state:
            case AdaptationState.SERVING:
                return f"{whom}: serves{since}{worth}; “Take back” in the window"
            case AdaptationState.OFFERED:
                return f"{whom}: offered{since}{worth}, does not serve; “Use it” in the window"
            case AdaptationState.TRYING:
                return f"{whom}: tried{since} beside the general model, does not serve"
            case _:
                return ""

    @property
    def text(self) -> str:
        """In words."""
        tried = "" if self.tried is None else self.tried.text
        strides = "" if self.tried is None else f" of the stride, on {self.tried.strides} later strides"
        match self.state:
            case AdaptationState.OFF:
                return self.why
            case AdaptationState.UNNAMED:
                return "name the wearer to learn from the walk: stop the recording, and start it with a name"
            case AdaptationState.COLLECTING:
                return f"learning from {self.wearer}: {self.stepped_s:.0f} of {LEARNED_S:.0f} s of steps"
            case AdaptationState.LEARNING:
                return f"learning from {self.wearer}: a copy of the model is trained"
            case AdaptationState.TRYING:
                tried_s = f"{self.stepped_s:.0f} of {TRIED_S:.0f} s of steps"
                return f"learned from {self.wearer}, tried beside the general model: {tried_s}"
            case AdaptationState.OFFERED:
                return f"learned from {self.wearer}: {tried}{strides}"
            case AdaptationState.SERVING:
                return f"learned from {self.wearer}, and serves: {tried}{strides}"
            case AdaptationState.NO_BETTER:
                return f"learned from {self.wearer}: no better than the general model ({tried})"
            case AdaptationState.DECLINED | AdaptationState.TAKEN_BACK:
                return f"learned from {self.wearer}, {self.state.value}: the general model serves"
            case AdaptationState.FAILED:
                return f"not learned from {self.wearer}: {self.why}"


def _time_of_day(utc_s: float) -> str:
    """Return the local time of day."""
    return f"{datetime.fromtimestamp(utc_s, UTC).astimezone():%H:%M}"
