"""A model's card, `model.json`: what it is, from what it was learned, how well it was judged, and where."""

import hashlib
import re
from collections.abc import Mapping
from datetime import UTC, datetime
from enum import Enum
from typing import Final

import msgspec
from msgspec import Struct

from ml.errors import UnusableModel

FORMAT: Final = 1
_NOT_CONTENT: Final = ("id", "made")  # two that learned the same have the same model, whenever that was


class DataSource(Enum):
    """Source of a model's examples."""

    RECORDED = "recorded"
    SIMULATED = "simulated"
    MIXED = "mixed"


class TableVersion(Struct, frozen=True):
    """A version of a table, by its location in a store: what the model was learned from, for ever."""

    store: str  # the store's URL
    location: str  # as in telemetry/000
    version: int


class ClassScore(Struct, frozen=True):
    """Scores of one class, on unseen data."""

    precision: float
    recall: float
    f1: float
    support: int  # decisions of which it was the truth


class Bin(Struct, frozen=True):
    """Decisions with about the same probability: what was said, and how often it was right."""

    said: float  # mean probability of the class that was decided for
    right: float  # share
    count: int


class Metrics(Struct, frozen=True):
    """Scores of a model, on unseen data.

    `confusion`: a row a true class, a column a class that was said, in the card's order; a last column for
    "unknown". `calibration_error` is the expected one: the mean of |said - right| over decisions.
    """

    figures: dict[str, float] = {}  # such as macro_f1, accuracy, rmse_percent, abstained
    per_class: dict[str, ClassScore] = {}
    per_subject: dict[str, float] = {}  # macro-F1, or for a phase RMSE in % of the cycle
    confusion: tuple[tuple[int, ...], ...] = ()
    calibration: tuple[Bin, ...] = ()
    calibration_error: float | None = None


class Card(Struct, frozen=True, kw_only=True):
    """Everything that is known of a model; `id` and `sha256` are filled in when it is published."""

    task: str
    recipe: str
    classes: tuple[str, ...]
    channels: tuple[str, ...]  # without every one of them it says nothing
    units: dict[str, str]  # of each channel
    ranges: dict[str, tuple[float, float]] = {}  # of each channel, from its 0.1 % to its 99.9 % quantile
    features_hash: str  # of the code that makes its features
    source: DataSource
    seed: int
    made: datetime
    versions: dict[str, str]  # of what learned it: python, scikit-learn, numpy, skops
    robot: str = ""  # "": for every robot that has the channels
    tables: tuple[TableVersion, ...] = ()
    learned: tuple[str, ...] = ()  # sessions
    held_out: tuple[str, ...] = ()  # sessions that it never saw
    metrics: Metrics = Metrics()
    parent: str = ""  # the model that it was adapted from
    notes: str = ""
    id: str = ""
    sha256: dict[str, str] = {}  # of each file beside the card
    format: int = FORMAT


def content_id(card: Card) -> str:
    """Return the name of a model with these files and this card, but for when it was made."""
    return f"{card.task}-{digest(card)[:12]}"


def digest(card: Card) -> str:
    """SHA-256 of the same: with the checksums of its files, it is the whole model's."""
    fields = msgspec.to_builtins(card)
    content = {name: value for name, value in fields.items() if name not in _NOT_CONTENT}
    return hashlib.sha256(msgspec.json.encode(content, order="sorted")).hexdigest()


def encoded(card: Card) -> bytes:
    """Return it as `model.json` has it: for people too."""
    return msgspec.json.format(msgspec.json.encode(card), indent=1) + b"\n"


def decoded(data: bytes) -> Card:
    """Return the card in a `model.json`.

    Raises:
        UnusableModel: it is none, or not the one that was published.

    """
    try:
        card = msgspec.json.decode(data, type=Card)
    except (ValueError, RecursionError) as error:  # bad UTF-8 is no `DecodeError`
        raise UnusableModel(f"model.json is no model's card: {error}") from None
    if card.format != FORMAT:
        raise UnusableModel(f"model.json has format {card.format}; this GWRMS reads {FORMAT}")
    if card.id != content_id(card):
        raise UnusableModel(
            "model.json was altered since it was published: its content is not that of its id"
        )
    return card


def check_robot(card: Card, robot: str, units: Mapping[str, str]) -> None:
    """Refuse a robot that the model is not for; `units` are those of the robot's channels.

    Raises:
        UnusableModel: it was adapted to another robot, a channel is missing, or has another unit.

    """
    if card.robot and card.robot != robot:
        raise UnusableModel(f"{card.id} was adapted to {card.robot}, and is not for {robot or 'every robot'}")
    missing = [name for name in card.channels if name not in units]
    if missing:
        raise UnusableModel(f"{card.id} needs {', '.join(missing)}, which {robot} does not have")
    other = [name for name in card.channels if units[name] != card.units.get(name)]
    if other:
        name = other[0]
        raise UnusableModel(
            f"{card.id} learned {name} in {card.units.get(name) or 'no unit'}, and {robot} gives it in "
            f"{units[name] or 'no unit'}: correct the robot's file, or learn a model of its own"
        )


def age_days(card: Card, now: datetime | None = None) -> float:
    """Return the age of a model."""
    return ((now or datetime.now(UTC)) - card.made).total_seconds() / 86_400


def checked_name(name: str, what: str) -> str:
    """Return a name that may stand in a path; raises `UnusableModel` where it may not."""
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9_.-]*", name):
        raise UnusableModel(f"{name!r} is no name of a {what}")
    return name
