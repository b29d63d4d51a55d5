"""How well gait events are found: against the simulator's truth, and with `--data` against recorded feet.

    python -m tests.bench.gait_events                 # simulator: pressure and kinematics; about two minutes
    python -m tests.bench.gait_events --data FILE     # foot IMUs: ipol_gait_dev.npz (IPOL 2023/497)
    python -m tests.bench.gait_events --data FILE     # or patients: of tools.impaired_gait (IPOL 2019/265)

F1 counts an event that is found within ±50 ms of a true one of its kind and foot.
"""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hil_sim.gait.activity import Activity
from hil_sim.gait.timetable import Entry
from server_gui.core.processing.component import ComponentProcessing
from server_gui.core.processing.foot_imu_events import FootImuEvents
from server_gui.core.processing.gait_events import EventKind, GaitEvent, Leg
from server_gui.core.processing.recording import summarise
from tests.bench._impaired_feet import against_groups
from tests.unit.processing.scoring import Score, matched
from tests.unit.processing.walks import FORCES, Walk, kind_of, record

GAITS = (
    Activity.WALK,
    Activity.STAIRS_UP,
    Activity.STAIRS_DOWN,
    Activity.RAMP_UP,
    Activity.RAMP_DOWN,
    Activity.TURN_LEFT,
    Activity.TURN_RIGHT,
)
EACH_S, SECONDS = 15.0, 124.0
PEOPLE = (0, 3, 6)
LEAST_F1 = 0.98  # of events from pressure
CHANNELS, MOST_SHARE = 60, 0.01  # of a core, for one robot's channels at 100 Hz
RATE_HZ = 100
PERIOD_NS = 10_000_000  # of the recorded feet

Scores = dict[tuple[str, str], Score]


def main(argv: Sequence[str] = ()) -> int:
    """Exit code: 1 where pressure is found worse than it must be, or processing costs too much."""
    parser = argparse.ArgumentParser(prog="tests.bench.gait_events")
    parser.add_argument("--data", type=Path, metavar="FILE", help="ipol_gait_dev.npz, or patients")
    data = parser.parse_args(argv).data
    if data is None:
        return against_truth()
    return against_groups(data) if "group" in np.load(data, allow_pickle=False) else against_feet(data)


# --- the simulator


def tour() -> list[Entry]:
    """Every gait, then sitting, standing up and a stumble."""
    gaits = [Entry(gait, EACH_S) for gait in GAITS]
    return [Entry(Activity.STAND, 2.0), *gaits, Entry(Activity.SIT, 7.0), Entry(Activity.STUMBLE)]


def against_truth() -> int:
    with tempfile.TemporaryDirectory() as folder:
        walks = [record(tour(), SECONDS, Path(folder) / "truth", person, person) for person in PEOPLE]
    least = 1.0
    for source, left_out in (("pressure", ()), ("kinematics", FORCES)):
        total: Scores = {}
        delays: list[float] = []
        for walk in walks:
            events = summarise(walk.stamps_ns, walk.without(*left_out)).events
            delays += [(event.known_ns - event.stamp_ns) / 1e6 for event in events]
            _add(total, _by_label(walk, events))
        _show(source, total, delays)
        if source == "pressure":
            least = min(one.f1 for (label, _), one in total.items() if label == "all")
    share = cost(walks[0])
    sys.stdout.write(f"\n{CHANNELS} channels at {RATE_HZ} Hz: {100 * share:.2f} % of a core\n")
    return int(least < LEAST_F1 or share > MOST_SHARE)


def _by_label(walk: Walk, events: list[GaitEvent]) -> Scores:
    """Per kind of event: over everything, and by what the wearer does at the time."""
    found: Scores = {}
    for kind in EventKind:
        for leg in Leg:
            true = [float(time_ns) for time_ns in walk.events[f"{leg}_{kind}"]]
            seen = [float(event.stamp_ns) for event in events if kind_of(event) == f"{leg}_{kind}"]
            _add(found, _split(kind, true, seen, lambda time_ns: ("all", walk.label_at(time_ns))))
    return found


def _split(
    kind: EventKind, true: list[float], found: list[float], labels: Callable[[float], Sequence[str]]
) -> Scores:
    """The same matches counted by label; a found event has the labels of the true one that it matches."""
    scores: Scores = {}
    for time_ns in true:
        for label in labels(time_ns):
            scores.setdefault((label, kind), Score()).true += 1
    for time_ns, meant in matched(true, found).items():
        for label in labels(time_ns if meant is None else meant):
            one = scores.setdefault((label, kind), Score())
            one.found += 1
            if meant is not None:
                one.errors_ns.append(time_ns - meant)
    return scores


def _add(total: Scores, more: Scores) -> None:
    for key, one in more.items():
        total.setdefault(key, Score()).add(one)


def _show(title: str, scores: Scores, delays_ms: list[float]) -> None:
    usual, most = np.percentile(delays_ms, [50, 95])
    sys.stdout.write(
        f"\n{title}: known {usual:.0f} ms after the event (95 %: {most:.0f} ms)\n"
        f"{'':<16}{'heel strike':>34}{'toe off':>34}\n"
        f"{'':<16}{'F1':>8}{'true':>6}{'found':>6}{'median':>8}{'5…95 %':>12} ms\n"
    )
    for label in sorted({label for label, _ in scores}):
        row = "".join(_cells(scores.get((label, kind), Score())) for kind in EventKind)
        sys.stdout.write(f"{label:<16}{row}\n")
    for (label, kind), one in scores.items():
        figures = {"source": title, "label": label, "event": kind, "f1": round(one.f1, 4), "true": one.true}
        sys.stdout.write(json.dumps(figures) + "\n")


def _cells(one: Score) -> str:
    if not one.errors_ns:
        return f"{one.f1:>8.3f}{one.true:>6}{one.found:>6}{'':>20}"
    low, high = np.percentile(one.errors_ns, [5, 95]) / 1e6
    return f"{one.f1:>8.3f}{one.true:>6}{one.found:>6}{one.median_ms:>8.0f}{f'{low:.0f}…{high:.0f}':>12}"


def cost(walk: Walk) -> float:
    """Share of a core for one robot, every row a batch of its own as a stream sends it."""
    columns = {name: column.tolist() for name, column in walk.columns.items()}
    joints = [name.partition(".")[0] for name in columns if name.endswith(".position")]
    columns |= {f"{joint}.following_error": [0.01] * len(walk.stamps_ns) for joint in joints}
    columns |= {f"{joint}.velocity": [0.0] * len(walk.stamps_ns) for joint in joints}
    others = CHANNELS - len(columns)
    columns |= {f"left_insole.cell_{cell}": [0.0] * len(walk.stamps_ns) for cell in range(others)}
    batches = [
        ([int(stamp_ns)], {name: [column[row]] for name, column in columns.items()})
        for row, stamp_ns in enumerate(walk.stamps_ns)
    ]
    processing = ComponentProcessing()
    began_s = time.process_time()
    for stamps_ns, row in batches:
        processing.take(stamps_ns, row)
    return (time.process_time() - began_s) / len(batches) * RATE_HZ


# --- recorded feet


def against_feet(file: Path) -> int:
    """Foot IMUs of people, against when each foot was in the air."""
    data = np.load(file, allow_pickle=False)
    columns = [str(name) for name in data["channels"]]
    trials = data["subject"].astype(int) * 1000 + data["trial"]
    scores: Scores = {}
    delays: list[float] = []
    for leg, foot in ((Leg.LEFT, "lfoot"), (Leg.RIGHT, "rfoot")):
        place = columns.index(f"{foot}_gyr_y")
        rate = -data["x"][:, place] * data["scale"][place]  # toes down positive
        for trial in np.unique(trials):
            rows = trials == trial
            events = list(_feet_events(leg, rate[rows]))
            delays += [(event.known_ns - event.stamp_ns) / 1e6 for event in events]
            labels = _labels(f"subject {trial // 1000:>2}", data["status"][rows], data["status_names"])
            for kind in EventKind:
                found = [float(event.stamp_ns) for event in events if event.kind is kind]
                _add(scores, _split(kind, _changes(data[f"{leg}_event"][rows], kind), found, labels))
    _show(f"foot IMUs of {len(np.unique(trials))} trials", scores, delays)
    return 0


def _feet_events(leg: Leg, rate: npt.NDArray[np.float64]) -> Iterator[GaitEvent]:
    detector = FootImuEvents(leg)
    for place, value in enumerate(rate.tolist()):
        event = detector.feed(place * PERIOD_NS, value)
        if event is not None:
            yield event


def _changes(air: npt.NDArray[np.int8], kind: EventKind) -> list[float]:
    """When the foot leaves the ground, or comes down (ns)."""
    step = 1 if kind is EventKind.TOE_OFF else -1
    samples = np.flatnonzero(np.diff(air) == step) + 1
    return [float(sample) * PERIOD_NS for sample in samples]


def _labels(
    subject: str, status: npt.NDArray[np.int8], names: npt.NDArray[np.str_]
) -> Callable[[float], Sequence[str]]:
    """What a moment of a trial counts under."""
    turns = np.flatnonzero(status == list(names).index("turn"))
    turn = int(turns[0]) if len(turns) else len(status)

    def labels(time_ns: float) -> Sequence[str]:
        sample = min(round(time_ns / PERIOD_NS), len(status) - 1)
        part = "before a turn" if sample < turn else "from a turn on"
        return "all", subject, part, f"in {names[status[sample]]}"

    return labels


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
