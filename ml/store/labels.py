"""Labels: what robot and wearer did, as somebody or something says; and which of a table's rows hold.

A row says that a label holds, or (`removed`) that the same one holds no more. Of rows that say of the same
robot, session, time, author and source the same label, the last counts (later.py; between several spools by
`written`), so that a label is one however often it was written.
"""

import itertools
import unicodedata
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime, timedelta
from enum import Enum
from typing import Any, Final, Self

from msgspec import Struct
from msgspec.structs import force_setattr

from ml.store.errors import StoreError
from ml.store.precedence import last

US_NS: Final = 1_000  # the store's times are microseconds

# What a wearer does at a moment; two of them at once contradict each other.
ACTIVITIES: Final = (
    "stand", "walk", "sit", "sit_to_stand", "stand_to_sit", "stairs_up", "stairs_down", "ramp_up",
    "ramp_down", "turn_left", "turn_right", "stumble", "fall", "lying", "get_up",
)  # fmt: skip
# What happens at one instant: the gait phase of a leg goes from one heel strike to the next.
INSTANTS: Final = ("left_heel_strike", "right_heel_strike", "left_toe_off", "right_toe_off")
WEARER: Final = "wearer "  # before a name: who wore the robot
REGRESSION: Final = "regression set"  # of a session: no model learns from it, each is judged by it


class LabelSource(Enum):
    """Source of a label, the most trusted first."""

    PERSON = "person"
    SIMULATOR = "simulator"  # its own truth
    SENSORS = "sensors"  # gait events found in the recording itself
    PSEUDO = "pseudo"  # a model that was sure enough: never more than that


class Label(Struct, frozen=True, order=True):
    """One label of a session, from `began_utc_ns` up to `ended_utc_ns`, which are the same for an instant."""

    robot: str
    session: str
    began_utc_ns: int
    ended_utc_ns: int
    label: str
    author: str
    source: LabelSource = LabelSource.PERSON

    def __post_init__(self) -> None:
        """Round times to the store's resolution."""
        for name in ("began_utc_ns", "ended_utc_ns"):
            force_setattr(self, name, getattr(self, name) // US_NS * US_NS)

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> Self:
        """Return the label that a row of the table tells of.

        Raises:
            StoreError: somebody has written it who is none of the sources.

        """
        return cls(
            robot=row["robot"],
            session=row["session"],
            began_utc_ns=utc_ns(row["utc"]),
            ended_utc_ns=utc_ns(row["ended"]),
            label=row["label"],
            author=row["author"] or "",
            source=_source(row),
        )

    def row(self, written_utc_ns: int, *, removed: bool = False) -> dict[str, Any]:
        """Return the fields of a row of the table `labels`."""
        return {
            "robot": self.robot,
            "session": self.session,
            "utc": self.began_utc_ns,
            "ended": self.ended_utc_ns,
            "label": self.label,
            "author": self.author,
            "source": self.source.value,
            "written": written_utc_ns,
            "removed": removed,
        }


def _source(row: Mapping[str, Any]) -> LabelSource:
    try:
        return LabelSource(row["source"])
    except ValueError:
        known = ", ".join(source.value for source in LabelSource)
        raise StoreError(
            f"the label {row['label']!r} of session {row['session']} of {row['robot']} has the source "
            f"{row['source']!r}; known are {known}: correct it with the program that wrote it"
        ) from None


def wearer(label: str) -> str | None:
    """Return the wearer that the label names, if any."""
    return label.removeprefix(WEARER) if label.startswith(WEARER) else None


def wearers(labels: Iterable[str], recorded: str = "") -> dict[str, list[str]]:
    """Return who wore the robot, by labels and the recording: person → how that was spelled."""
    spelled = {name for each in labels if (name := wearer(each))} | ({recorded} - {""})
    found: dict[str, list[str]] = {}
    for name in sorted(spelled):
        if who := person(name):
            found.setdefault(who, []).append(name)
    return found


def counts(label: str) -> bool:
    """Return whether a label is more than words: models learn from it, or it is of the whole session."""
    return label in (*ACTIVITIES, *INSTANTS, REGRESSION) or wearer(label) is not None


def person(name: str) -> str:
    """Return the common form of all spellings of a person's name: `P01`, `p01 `, `P-01` and `P1` are `p1`.

    Capitals, spaces, signs and leading zeros are nothing; but numbers stay apart: `1-11` is not `11-1`.
    """
    text = unicodedata.normalize("NFKC", unicodedata.normalize("NFKC", name).casefold())
    found: list[str] = []
    for kind, run in itertools.groupby(text, _kind):
        if kind != "-":
            word = "".join(run)
            found.append((word.lstrip("0") or "0") if kind == "N" else word)
    return "".join(
        f"-{word}" if before and before[-1].isdigit() and word[0].isdigit() else word
        for before, word in itertools.pairwise(["", *found])
    )


def _kind(sign: str) -> str:
    """Return the kind of a sign: a letter (with its marks), a number, or another."""
    return {"L": "L", "M": "L", "N": "N"}.get(unicodedata.category(sign)[0], "-")


def holding(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the valid rows of the table `labels`, in time's order; each label once."""
    said = last(rows, _key, _written)
    return sorted((dict(row) for row in said if not row.get("removed")), key=_order)


def utc_ns(time: datetime) -> int:
    """Return a time of the store in ns since 1970."""
    return (time - datetime(1970, 1, 1, tzinfo=UTC)) // timedelta(microseconds=1) * US_NS


def _key(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return tuple(row[name] for name in ("robot", "session", "utc", "ended", "label", "author", "source"))


def _written(row: Mapping[str, Any]) -> tuple[bool, Any]:
    """Rows of stores from before there was such a column come first."""
    written = row.get("written")
    return (written is not None, written or row["utc"])


def _order(row: Mapping[str, Any]) -> tuple[Any, ...]:
    return (row["utc"], row["ended"], row["label"], row["author"])
