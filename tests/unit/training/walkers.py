"""Recordings of made-up wearers in a store, with labels: small, quick, and told apart by their joints."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from ml.features.windows import Samples
from ml.robot.groups import GROUPS, unit
from ml.store import Store
from ml.store.labels import WEARER, Label, LabelSource
from server_gui.core.recording import records
from server_gui.core.recording.records import Facts, Worn
from server_gui.core.recording.rows import Layout, Record, Run
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send

S: Final = 10**9
HZ: Final = 100
BEGAN_UTC: Final = 1_800_000_000 * S
CHANNELS: Final = (*GROUPS["hips"], *GROUPS["knees"])
STRIDE_S: Final = 1.2

Said = tuple[float, float, str, LabelSource]  # seconds from the session's beginning


@dataclass(frozen=True)
class Made:
    """One session: values (n, channels) at 100 Hz, and its labels."""

    session: str
    values: Samples
    said: Sequence[Said]
    channels: tuple[str, ...] = CHANNELS
    units: dict[str, str] | None = None
    wearer: str = ""  # as a label says
    recorded_wearer: str = ""
    robot: str = "exo"


def stamps_ns(count: int) -> npt.NDArray[np.int64]:
    return 7_000 * S + np.arange(count, dtype=np.int64) * (S // HZ)


def put(url: str, spool: Path, sessions: Sequence[Made]) -> Store:
    """Into the spool, and from there into the store, as everything recorded comes there."""
    store = Store(url)
    with Spool(spool, reserve_bytes=0) as opened:
        for number, made in enumerate(sessions):
            began = BEGAN_UTC + number * 3600 * S
            opened.append([_run(made, began)], list(_records(made, began)))
        opened.freeze()
        for batch in opened.waiting():
            send(opened, batch, store)
    return store


def _units(made: Made) -> dict[str, str]:
    return made.units or {name: unit(name) for name in made.channels}


def _run(made: Made, began: int) -> Run:
    count = len(made.values)
    layout = Layout(made.channels, tuple(_units(made).get(name) for name in made.channels))
    stamps, numbers = stamps_ns(count), np.arange(count, dtype=np.int64)
    offset = np.full(count, began - stamps[0], np.int64)
    return Run(
        made.robot, made.session, made.session, 1, layout, stamps, numbers, numbers * 0, offset, made.values.T
    )


def _records(made: Made, began: int) -> list[Record]:
    ended = began + len(made.values) * S // HZ
    facts = Facts(units=_units(made), worn=Worn(made.recorded_wearer))
    session = records.Session(made.robot, made.session, began, facts, ended)
    found = [session.record()]
    for begin, end, name, source in made.said:
        first, last = (began + round(second * 1000) * 10**6 for second in (begin, end))
        found.append(records.label(Label(made.robot, made.session, first, last, name, source.value, source)))
    if made.wearer:
        found.append(
            records.label(Label(made.robot, made.session, began, ended, WEARER + made.wearer, "ada"))
        )
    return found


# --- wearers

Motion = Callable[[npt.NDArray[np.float64], np.random.Generator], Samples]


def walk(t: npt.NDArray[np.float64], random: np.random.Generator, late: float = 0.0) -> Samples:
    """`late`: by how much of a stride this wearer's legs are behind other people's when a heel strikes."""
    angle = 2 * np.pi * (t / STRIDE_S - late)
    size = random.uniform(0.9, 1.1)
    legs = [(0.3 * np.cos(a), 0.5 + 0.4 * np.sin(a)) for a in (angle, angle + np.pi)]
    return size * np.stack([legs[0][0], legs[1][0], legs[0][1], legs[1][1]], axis=1)


def stand(t: npt.NDArray[np.float64], random: np.random.Generator) -> Samples:
    return _still(0.05, t, random)


def sit(t: npt.NDArray[np.float64], random: np.random.Generator) -> Samples:
    return _still(1.5, t, random)


def _still(angle: float, t: npt.NDArray[np.float64], random: np.random.Generator) -> Samples:
    """Nobody is a statue: it sways, now this way, now that."""
    sway = np.sin(2 * np.pi * (random.uniform(0.1, 0.4, 4) * t[:, None] + random.uniform(0, 1, 4)))
    return angle + 0.1 * sway


def late_walk(t: npt.NDArray[np.float64], random: np.random.Generator) -> Samples:
    return walk(t, random, late=0.1)


MOTIONS: Final[dict[str, Motion]] = {"walk": walk, "stand": stand, "sit": sit}


def day(
    name: str,
    seed: int,
    order: Sequence[str] = ("stand", "walk", "sit"),
    each_s: float = 8.0,
    source: LabelSource = LabelSource.PERSON,
    wearer: str = "",
    strikes: bool = False,
    motions: Mapping[str, Motion] = MOTIONS,
) -> Made:
    """Stretches of what they do, one after the other."""
    random = np.random.default_rng(seed)
    t = np.arange(int(each_s * HZ)) / HZ
    parts = [motions[what](t, random) for what in order]
    values = np.concatenate(parts) + random.normal(0.0, 0.01, (len(t) * len(order), 4))
    said = [(at * each_s, (at + 1) * each_s, what, source) for at, what in enumerate(order)]
    if strikes:
        for at, what in enumerate(order):
            said += _strikes(at * each_s, each_s, source) if what == "walk" else []
    return Made(name, values, said, wearer=wearer)


def _strikes(begin_s: float, length_s: float, source: LabelSource) -> list[Said]:
    times = np.arange(0.0, length_s - 1e-6, STRIDE_S)
    left = [(begin_s + t, begin_s + t, "left_heel_strike", source) for t in times.tolist()]
    later = [t for t in (times + STRIDE_S / 2).tolist() if t < length_s]
    return [*left, *((begin_s + t, begin_s + t, "right_heel_strike", source) for t in later)]
