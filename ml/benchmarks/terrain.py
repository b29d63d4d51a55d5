"""`aust-mode`: level ground, stairs up and down, or an incline, at places never seen before."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt
from sklearn.model_selection import StratifiedGroupKFold

from ml.benchmarks import folds, metrics
from ml.benchmarks.arrays import Arrays
from ml.benchmarks.models.terrain import TerrainSettings, terrain_model
from ml.benchmarks.outcome import Outcome
from ml.benchmarks.search import Search, chosen, told
from ml.features.terrain import RATE_HZ, TERRAIN

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

Integers = npt.NDArray[np.int_]


def evaluate(path: Path, search: Search) -> Outcome:
    """Windows that share rows stay together; then, apart, leave one sector of headings out."""
    columns, mode, shared, sector = read(path)
    stratified = StratifiedGroupKFold(5, shuffle=True, random_state=0).split(columns, mode, shared)
    by_rows, row_settings = _predicted(columns, mode, shared, list(stratified), search)
    by_sector, sector_settings = _predicted(columns, mode, sector, list(folds.one_left_out(sector)), search)
    figures = {
        "macro_f1": metrics.macro_f1(mode, by_rows, len(MODES)),
        "sector_macro_f1": metrics.macro_f1(mode, by_sector, len(MODES)),
        "accuracy": metrics.accuracy(mode, by_rows),
        "sector_accuracy": metrics.accuracy(mode, by_sector),
    }
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


def read(path: Path) -> tuple[npt.NDArray[np.float32], Integers, Integers, Integers]:
    """Each window's features, mode, group of windows that share rows, and sector of headings; no falls.

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
    return TERRAIN.compute(signals), modes[own], folds.sharing(windows), sector


def _predicted(
    columns: npt.NDArray[np.float32],
    mode: Integers,
    groups: Integers,
    splits: Sequence[folds.Split],
    search: Search,
) -> tuple[Integers, list[TerrainSettings]]:
    """The predictions of the folds that had not seen a window."""

    def score(settings: TerrainSettings, train: folds.Rows, judge: folds.Rows) -> float:
        found = terrain_model(settings).fit(columns[train], mode[train]).predict(columns[judge])
        return metrics.macro_f1(mode[judge], found, len(MODES))

    def fold(split: folds.Split) -> tuple[Integers, TerrainSettings]:
        train, held_out = split
        settings = chosen(
            SETTINGS,
            GRID,
            groups[train],
            search,
            lambda one, rows, judge: score(one, train[rows], train[judge]),
        )
        model = terrain_model(settings).fit(columns[train], mode[train])
        return model.predict(columns[held_out]), settings

    work = folds.over(fold, splits)
    predicted = np.empty_like(mode)
    for (_, held_out), (found, _) in zip(splits, work, strict=True):
        predicted[held_out] = found
    return predicted, [settings for _, settings in work]


def _degrees(sector: int) -> str:
    begin = sector * SECTOR_DEG - 180.0
    return f"{begin:+.0f}° to {begin + SECTOR_DEG:+.0f}°"
