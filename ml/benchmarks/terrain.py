"""`aust-mode`: level ground, stairs up and down, or an incline, at places never seen before."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from sklearn.model_selection import StratifiedGroupKFold

from ml.benchmarks import folds, losses, metrics
from ml.benchmarks.arrays import Arrays
from ml.benchmarks.models.terrain import TerrainSettings, terrain_model
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.features.terrain import RATE_HZ, TERRAIN
from ml.features.windows import Samples

MODES: Final = ("level", "stair_up", "stair_down", "incline20_treadmill")
CHANNELS: Final = (
    *(f"hip_{side}_{quantity}" for quantity in ("rad", "vel_rad_s") for side in "lr"),
    *(f"acc_{axis}" for axis in "xyz"),
    *(f"gyr_{axis}_deg_s" for axis in "xyz"),
    "euler_x_deg",
    "euler_y_deg",
)
YAW: Final = "euler_z_deg"  # only for the sectors, never a feature
SECTOR_DEG: Final = 30.0
SETTINGS: Final = TerrainSettings()
GRID: Final = tuple(
    TerrainSettings(cost, sharpness) for cost in (3.0, 10.0, 30.0) for sharpness in (1.0, 2.0)
)

FEWEST: Final = 5  # windows of each mode, one for each fold
NAMELESS: Final = "The recordings do not say whose they are: the same people may be on both sides."
DEGREES: Final = np.array([np.pi / 180.0 if "deg" in channel else 1.0 for channel in CHANNELS])

SENSORS: Final = (1, 1, 1, 1, 8)  # channels of both encoders and their rates, and of the IMU

Integers = npt.NDArray[np.int_]
Columns = npt.NDArray[np.float32]


def evaluate(path: Path, search: Search) -> Outcome:
    """Windows that share rows stay together; then, apart, leave one sector of headings out."""
    signals, mode, shared, sector = read(path)
    every = {0.0: TERRAIN.compute(signals)}
    every |= {share: TERRAIN.compute(_lossy(signals, share)) for share in losses.SHARES}
    stratified = StratifiedGroupKFold(5, shuffle=True, random_state=0).split(signals, mode, shared)
    rows_found, row_settings = _predicted(every, mode, shared, list(stratified), search)
    sectors_found, sector_settings = _predicted(every, mode, sector, list(folds.one_left_out(sector)), search)
    by_rows, by_sector = rows_found[0.0], sectors_found[0.0]
    figures = {
        "macro_f1": metrics.macro_f1(mode, by_rows, len(MODES)),
        "sector_macro_f1": metrics.macro_f1(mode, by_sector, len(MODES)),
        "accuracy": metrics.accuracy(mode, by_rows),
        "sector_accuracy": metrics.accuracy(mode, by_sector),
    }
    for share in losses.SHARES:
        for name, found in (("macro_f1", rows_found), ("sector_macro_f1", sectors_found)):
            figures[losses.at(name, share)] = metrics.macro_f1(mode, found[share], len(MODES))
    groups = {
        f"{_degrees(one)}": {
            "sector_accuracy": metrics.accuracy(mode[sector == one], by_sector[sector == one]),
            "windows": float((sector == one).sum()),
        }
        for one in np.unique(sector)
    }
    counts = metrics.confusion(mode, by_sector, len(MODES))
    settings = told([*row_settings, *sector_settings], search)
    return Outcome(figures, None, groups, "sector of headings", MODES, counts, settings, (NAMELESS,))


def read(path: Path) -> tuple[Samples, Integers, Integers, Integers]:
    """Windows (n, channels, samples) without falls; each one's mode, group that shares rows, and sector.

    Raises:
        UnusableData: it is not such a file, or has samples that cannot be.

    """
    file = Arrays(path)
    file.rate(RATE_HZ)
    x = file.of("x", 3)
    labels = file.of("y", 1, len(x)).astype(np.int_)
    names = [str(name) for name in file.of("names", 1)]
    if missing := [mode for mode in MODES if mode not in names]:
        raise file.problem(f"knows no {', '.join(missing)}; it has {', '.join(names)}")
    if x.shape[1] != TERRAIN.look_back:
        raise file.problem(f"has windows of {x.shape[1]} samples; expected are {TERRAIN.look_back}")
    modes = np.array([MODES.index(name) if name in MODES else -1 for name in names])[labels]
    own = modes >= 0
    columns, yaw = file.columns(CHANNELS), file.columns([YAW])
    windows = x[own].astype(np.float64)
    file.finite(windows)
    file.gravity(windows[..., [columns[at] for at in (4, 5, 6)]], "the back's")
    sector = np.floor((windows[..., yaw[0]].mean(axis=1) + 180.0) / SECTOR_DEG).astype(np.int_)
    if missing_modes := [name for at, name in enumerate(MODES) if (modes == at).sum() < FEWEST]:
        raise file.problem(f"has fewer than {FEWEST} windows of {', '.join(missing_modes)}")
    if len(np.unique(sector)) < 2:
        raise file.problem("has one sector of headings alone: none is left to learn from")
    signals = np.ascontiguousarray(windows[..., columns].transpose(0, 2, 1)) * DEGREES[:, None]
    return signals, modes[own], folds.sharing(windows), sector


def _lossy(signals: Samples, share: float) -> Samples:
    """Windows with so many of each sensor's packets lost; a sensor of which none is left has its newest."""
    lost = losses.lossy(signals.transpose(0, 2, 1), SENSORS, share, 0).transpose(0, 2, 1)
    nothing = np.isnan(lost).all(axis=-1)
    lost[nothing, -1] = signals[nothing, -1]
    return lost


def _predicted(
    every: Mapping[float, Columns],
    mode: Integers,
    groups: Integers,
    splits: Sequence[folds.Split],
    search: Search,
) -> tuple[dict[float, Integers], list[TerrainSettings]]:
    """Return, by the share of lost packets, the predictions of the folds that had not seen a window."""
    columns = every[0.0]

    def score(settings: TerrainSettings, train: folds.Rows, judge: folds.Rows) -> float:
        found = terrain_model(settings).fit(columns[train], mode[train]).predict(columns[judge])
        return metrics.macro_f1(mode[judge], found, len(MODES))

    def fold(split: folds.Split) -> tuple[dict[float, Integers], TerrainSettings]:
        train, held_out = split
        settings = chosen(
            SETTINGS,
            GRID,
            groups[train],
            search,
            lambda one, rows, judge: score(one, train[rows], train[judge]),
        )
        model = terrain_model(settings).fit(columns[train], mode[train])
        return {share: model.predict(one[held_out]) for share, one in every.items()}, settings

    work = folds.over(fold, splits)
    predicted = {share: np.empty_like(mode) for share in every}
    for (_, held_out), (found, _) in zip(splits, work, strict=True):
        for share, labels in found.items():
            predicted[share][held_out] = labels
    return predicted, [settings for _, settings in work]


def _degrees(sector: int) -> str:
    begin = sector * SECTOR_DEG - 180.0
    return f"{begin:+.0f}° to {begin + SECTOR_DEG:+.0f}°"
