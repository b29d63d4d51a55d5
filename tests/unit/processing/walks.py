"""The simulated robot as the server would have recorded it: sensors' values in columns, and the truth."""

import bisect
import json
import random
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hil_sim.gait.timetable import Entry
from hil_sim.truth import TruthFile
from hil_sim.without_bus import BareExoskeleton
from server_gui.core.processing.gait_events import GaitEvent

FORCES = ("left_insole.force", "right_insole.force")


@dataclass(frozen=True)
class Walk:
    """Columns as the wire names them, at 100 Hz; true events by kind such as `left_toe_off`."""

    stamps_ns: npt.NDArray[np.int64]
    columns: dict[str, npt.NDArray[np.float64]]
    events: dict[str, list[int]]
    labels: list[str]

    def label_at(self, stamp_ns: float) -> str:
        place = bisect.bisect(self.stamps_ns.tolist(), stamp_ns)
        return self.labels[min(place, len(self.labels) - 1)]

    def without(self, *channels: str) -> dict[str, npt.NDArray[np.float64]]:
        return {name: column for name, column in self.columns.items() if name not in channels}


def kind_of(event: GaitEvent) -> str:
    return f"{event.leg}_{event.kind}"


def record(entries: Iterable[Entry], seconds: float, file: Path, seed: int = 0, person: int = 0) -> Walk:
    """Let the simulator do that, and listen to its sensors before they speak any language."""
    robot = BareExoskeleton(seed=seed, person=person)
    truth = TruthFile(file, robot)
    rows: list[tuple[float, ...]] = []

    def listen() -> None:
        soles, imu = robot.sensors._soles, robot.sensors._imu
        pressures = [sole._last.pascal if sole._last else () for sole in soles]
        forces = [
            sum(pascal * cell.area for pascal, cell in zip(felt, sole.cells, strict=True))
            for felt, sole in zip(pressures, soles, strict=True)
        ]
        angles = [drive.joint.position for drive in robot.drives.values()]
        tilt = imu._last.angles[1] if imu._last else 0.0
        rows.append((robot.clock.now_ns, *forces, *angles, tilt))

    robot.measured.append(listen)
    robot.power_on()
    robot.follow(entries)
    robot.clock.run_until(round(seconds * 1e9))
    truth.close()
    names = [*FORCES, *(f"{name}.position" for name in robot.drives), "trunk.tilt_forward"]
    data = np.array(rows)
    columns = {name: data[:, 1 + place].copy() for place, name in enumerate(names)}
    return Walk(data[:, 0].astype(np.int64), columns, *_truth(file))


def _truth(file: Path) -> tuple[dict[str, list[int]], list[str]]:
    head, *lines = (json.loads(line) for line in file.read_text(encoding="utf-8").splitlines())
    time, label, happened = (head["columns"].index(name) for name in ("simulated_ns", "label", "events"))
    events: dict[str, list[int]] = {}
    for line in lines:
        for event in line[happened]:
            events.setdefault(event, []).append(line[time])
    return events, [line[label] for line in lines]


def with_noise(walk: Walk, newtons: float, lost: float, seed: int = 1) -> dict[str, npt.NDArray[np.float64]]:
    """The forces of a worse insole: noise, and a share of samples that never came."""
    source = random.Random(seed)
    noisy = {name: walk.columns[name].copy() for name in FORCES}
    for column in noisy.values():
        column += [source.gauss(0.0, newtons) for _ in column]
        np.maximum(column, 0.0, out=column)
        column[[source.random() < lost for _ in column]] = np.nan
    return noisy
