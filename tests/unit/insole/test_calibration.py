"""Calibration of each cell: polarity, tare, laws, saturation, and files that are wrong."""

from pathlib import Path

import msgspec
import pytest

from drivers.errors import SettingsError
from drivers.insole.calibration import Calibration, CellCalibration, Cells, load


def pressure(raw: float, **keys: object) -> float | None:
    calibration = Calibration(default=msgspec.convert(keys, CellCalibration))
    return Cells(calibration, 1).pressures([raw])[0]


@pytest.mark.parametrize(
    ("raw", "keys", "pascal"),
    [
        (110, {"tare": 10, "gain": 50}, 5000),
        (5, {"tare": 10, "gain": 50}, 0),
        (4000, {"polarity": "falling", "full_scale": 4095, "tare": 5, "gain": 10}, 900),
        (103, {"law": "power", "tare": 3, "gain": 2, "exponent": 1.5}, 2000),
        (3995, {"law": "power", "polarity": "falling", "full_scale": 4095, "gain": 1, "exponent": 2}, 10_000),
        (150, {"law": "table", "table": [[0, 0], [100, 1000], [200, 5000]]}, 3000),
        (60, {"law": "table", "tare": 10, "table": [[0, 0], [100, 1000]]}, 500),
        (-5, {"law": "table", "table": [[0, 0], [100, 1000]]}, 0),
        (900, {"law": "table", "table": [[0, 0], [100, 1000]]}, 1000),
    ],
)
def test_law(raw: float, keys: dict[str, object], pascal: float) -> None:
    assert pressure(raw, **keys) == pytest.approx(pascal)


def test_cell_of_its_own_beside_the_default() -> None:
    cells = Cells(Calibration(default=CellCalibration(gain=1.0), cell={"1": CellCalibration(gain=2.0)}), 3)
    assert cells.pressures([10, 10, None]) == (10, 20, None)


def test_saturation_is_seen_after_polarity() -> None:
    falling = CellCalibration(polarity="falling", full_scale=4095, saturation=4000)
    cells = Cells(Calibration(default=falling), 2)
    assert not cells.saturated([4095, 96])
    assert cells.saturated([4095, 95])
    assert not cells.saturated([None, 4095])


def test_end_of_a_table_saturates() -> None:
    cells = Cells(Calibration(default=CellCalibration(law="table", table=((0, 0), (100, 1000)), tare=5)), 1)
    assert not cells.saturated([104])
    assert cells.saturated([105])


def test_cell_without_a_calibration_and_cell_that_is_not_there_are_named() -> None:
    with pytest.raises(SettingsError, match="nothing of cell 1"):
        Cells(Calibration(cell={"0": CellCalibration()}), 2)
    with pytest.raises(SettingsError, match="has a cell 2; the layout ends at cell 1"):
        Cells(Calibration(default=CellCalibration(), cell={"2": CellCalibration()}), 2)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[default]\npolarity = "falling"', "full_scale"),
        ('[default]\nlaw = "table"', "belong together"),
        ("[default]\ntable = [[0, 0], [1, 1]]", "belong together"),
        ('[default]\nlaw = "table"\ntable = [[1, 0], [0, 1]]', "both rising"),
        ("[default]\ngain = 0", "gain"),
        ("[cell.left]\ngain = 1", "numbered from 0"),
        ("[default]\nslope = 1", "slope"),
        ("[", "insole calibration"),
    ],
)
def test_wrong_file_is_named(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "left.toml"
    path.write_text(text)
    with pytest.raises(SettingsError, match=words) as caught:
        load(path)
    assert str(path) in str(caught.value)
