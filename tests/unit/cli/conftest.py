"""A robot of fake devices that `gwrms` is typed at."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.unit.cli.served import EDS, VELOCITY, Served
from tests.unit.gateway.harness import DISABLED, ROBOT, Bench, config, serving


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[Served]:
    bench = Bench()
    monkeypatch.setattr("gateway.modules.component.module.assemble", bench.assemble)
    monkeypatch.chdir(tmp_path)
    for drive in (bench.left, bench.right):
        drive.set_state(DISABLED)
        drive.node.objects |= {
            VELOCITY: (65190).to_bytes(4, "little"),
            (0x6083, 0): (260_000).to_bytes(4, "little"),
            (0x6084, 0): (260_000).to_bytes(4, "little"),
            (0x1017, 0): (100).to_bytes(2, "little"),
        }
    text = ROBOT.replace("gear_ratio = 100.0\n", "gear_ratio = 100.0" + EDS)
    with serving(config(tmp_path, text)) as (host, port):
        yield Served(bench, f"{host}:{port}")
