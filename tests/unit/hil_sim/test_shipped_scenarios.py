"""Scenarios that ship are found by their names, as devices' files are."""

from pathlib import Path

import pytest

from hil_sim.cli import run, sim
from hil_sim.scenario.script import load
from hil_sim.scenario.shipped import locate, shipped
from hil_sim.scenario.table import ScenarioError

FOLDER = Path(__file__).parents[3] / "scenarios"


@pytest.mark.parametrize("name", ["node_lost", "node_lost.toml"])
def test_one_that_ships_is_found_by_its_name(name: str) -> None:
    assert locate(Path(name)).read_bytes() == (FOLDER / "node_lost.toml").read_bytes()


def test_a_file_of_ones_own_goes_before(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    mine = Path("node_lost.toml")
    mine.touch()
    assert locate(mine) == mine


@pytest.mark.parametrize("name", ["node_lots", "elsewhere/node_lost.toml", "node_lost.yaml"])
def test_what_is_nowhere_is_told_with_what_ships(name: str) -> None:
    with pytest.raises(
        ScenarioError, match=f"{name}: there is no such file.* did you mean 'node_lost'.*late_boot"
    ):
        locate(Path(name))


def test_all_that_ship_can_be_run() -> None:
    assert [load(locate(Path(name))).title for name in shipped()]
    assert len(shipped()) == len(list(FOLDER.glob("*.toml")))


def test_the_commands_find_them(capsys: pytest.CaptureFixture[str]) -> None:
    assert run.main(["nod_lost"]) == 2
    assert "did you mean 'node_lost'?" in capsys.readouterr().err
    with pytest.raises(ScenarioError, match="did you mean 'node_lost'"):
        sim.main(["--dir", "robot", "--script", "nod_lost"])
