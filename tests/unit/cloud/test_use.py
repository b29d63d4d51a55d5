"""`gwrms sessions resources` and `compare`: leaks, and what a new version costs, out of a store."""

import json
import random
from pathlib import Path
from typing import Any

import pytest

from gateway.main import main
from gateway.wire.resource import ProcessUse
from ml.store import Store
from server_gui.core.recording import records
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.records import Facts
from server_gui.core.recording.spool import Spool
from server_gui.core.recording.upload import send
from tests.unit.processing.test_resource import MIB, look

MINUTES, LOOKS = 40, 4  # of each minute


def recorded(folder: Path, url: str, *versions: str) -> list[str]:
    """A session each, in which `logger` leaks 1 MiB a minute, and `planner` takes ten times its version."""
    chance = random.Random(1)
    names = []
    with Spool(folder / "spool", reserve_bytes=0) as spool:
        with Recorder(spool) as recorder:
            for version in versions:
                names.append(recorder.begin("exo-01", Facts(versions={"gateway": version})))
                rows = []
                for number in range(MINUTES * LOOKS):
                    second = number * 60 / LOOKS
                    processes = (
                        ProcessUse(7, "logger", 1.0 + chance.random(), 20 * MIB + round(second / 60 * MIB)),
                        ProcessUse(8, "planner", 10.0 * float(version) + chance.random(), 50 * MIB),
                        ProcessUse(9, "planner", 1.0, 50 * MIB),
                        ProcessUse(10, "kworker/0:1", 0.0, 0),
                        ProcessUse(11, "idler", 0.0, MIB),
                    )
                    utc_ns = round((1_700_000_040 + second) * 1e9)
                    rows.append(records.resources("exo-01", names[-1], utc_ns, look(second, *processes)))
                recorder.add(*rows)
        store = Store(url)
        for number in spool.waiting():
            send(spool, number, store)
    return names


@pytest.fixture
def ask(folder_url: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Any:
    def asked(*words: str, status: int = 0) -> str:
        assert main(["sessions", *words, "--url", folder_url]) == status
        return capsys.readouterr().out

    return asked


def test_programs_are_listed_and_leaks_named(ask: Any, folder_url: str, tmp_path: Path) -> None:
    (name,) = recorded(tmp_path, folder_url, "1")
    planner, logger, *_ = json.loads(ask("resources", name, "--json"))
    assert (planner["name"], planner["memory_bytes"], planner["leak"]) == ("planner", 100 * MIB, None)
    assert planner["cpu_percent"] == pytest.approx(11.5, abs=0.2)
    assert logger["leak"]["value"] == pytest.approx(60 * MIB, rel=0.02)
    shown = ask("resources", name)
    assert "+60.0 MiB, leaks" in shown
    assert shown.count("leaks") == 1


def test_what_never_used_anything_is_left_out_and_counted(ask: Any, folder_url: str, tmp_path: Path) -> None:
    (name,) = recorded(tmp_path, folder_url, "1")
    shown = ask("resources", name)
    assert "kworker" not in shown
    assert "1 program left out that never used anything" in shown
    assert "idler" in shown, "memory is a use too"
    everything = ask("resources", name, "--all")
    assert "kworker" in everything
    assert "left out" not in everything
    assert "kworker/0:1" in [one["name"] for one in json.loads(ask("resources", name, "--json"))]


def test_what_a_version_costs_more_is_named_and_ends_with_1(
    ask: Any, folder_url: str, tmp_path: Path
) -> None:
    old, new = recorded(tmp_path, folder_url, "1", "2")
    (found,) = json.loads(ask("compare", old, new, "--json", status=1))
    assert (found["process"], found["measure"]) == ("planner", "cpu_percent")
    told = ask("compare", old, new, status=1)
    assert "compared: 40 minutes before, 40 after" in told
    assert "planner uses 87 % more with gateway 2: 11.5 → 21.5 % of a core against gateway 1" in told
    assert "nothing surely takes more" in ask("compare", new, old)
