"""`gwrms bench` against a gateway: what it asks, what it shows, and that it changes nothing."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from gateway.cli import bench as command
from gateway.main import main
from tests.unit.gateway.harness import Bench, config, serving

ROWS = [
    "CPU and memory",
    "every process",
    "… by psutil, here",
    "every component",
    "all channels, 50 Hz",
    "all channels, 1000 Hz",
]


@contextmanager
def gateway(folder: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    monkeypatch.setattr(command, "SECONDS", 0.2)
    with serving(config(folder)) as (host, port):
        yield f"{host}:{port}"


def test_every_figure_for_machines(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with gateway(tmp_path, monkeypatch) as address:
        assert main(["bench", "--requests", "10", "--json", "--robot", address]) == 0
    figures = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert [one["what"] for one in figures] == ROWS
    asked, streamed = figures[:4], figures[4:]
    for one in asked:
        assert one["count"] == 10
        assert 0 < one["p50_ms"] <= one["p99_ms"]
        assert one["cpu_ms"] >= 0
    for one in streamed:
        assert one["count"] > 0
        assert one["p50_ms"] <= one["p99_ms"]
    assert all(one["rss_bytes"] > 1 << 20 for one in figures if "psutil" not in one["what"])
    assert {drive.stops for drive in (bench.left, bench.right)} == {0}
    assert not [entry for node in (bench.left, bench.gait) for entry in node.node.log if "download" in entry]


def test_a_table_for_people(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with gateway(tmp_path, monkeypatch) as address:
        assert main(["bench", "--requests", "10", "--robot", address]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["COUNT", "LOST", "P50", "P99", "CPU", "A", "REQUEST", "CPU", "MEMORY"]
    assert [line[: len(row)] for line, row in zip(lines[1:], ROWS, strict=True)] == ROWS


@pytest.mark.parametrize("count", ["9", "many", "-5", "1000001"])
def test_a_number_of_requests_that_makes_no_sense(count: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["bench", "--requests", count])
    assert "no number of requests from 10 to 1000000" in capsys.readouterr().err
