"""The journal as clients meet it: a flood by one of them takes nothing from another."""

from pathlib import Path
from typing import Any

import pytest

from gateway.records.folder import RecordsFolder
from gateway.records.journal import read_verified
from gateway.records.limits import ENTRIES_AT_ONCE, LEFT_OUT
from tests.unit.gateway.harness import ROBOT, Bench, Client, config, serving

KEPT = ROBOT.replace("linger_s = 0.05", 'linger_s = 0\nrecords = "records"')


def entries(tmp_path: Path) -> list[dict[str, Any]]:
    return read_verified(RecordsFolder(tmp_path / "records").journal)


@pytest.fixture(autouse=True)
def slow_refill(monkeypatch: pytest.MonkeyPatch) -> None:
    """However long a flood takes here, its client gets nothing more meanwhile."""
    monkeypatch.setattr("gateway.records.limits.ENTRIES_A_SECOND", 0.001)


def test_a_client_that_floods_takes_no_entry_from_another(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path, KEPT)) as address, Client(address) as ada, Client(address) as ben:
        ada.call("hello", client="ada", protocol=1)
        ben.call("hello", client="ben", protocol=1)
        for _ in range(ENTRIES_AT_ONCE):
            ada.request("control.acquire", ttl_s=60)
            ada.answer(ada.request("control.release"))
        ben.call("control.acquire", ttl_s=60)
        ben.call("parameter.write", changes={"gait.cycle_time": 1.3})
        ben.call("robot.stop", reason="enough")
        tail = ben.call("journal.tail", n=1000)
        assert tail["cut"] is None
    told = entries(tmp_path)
    assert [one["what"] for one in told if one["who"].startswith("ben")][:5] == [
        "lease taken",
        "write",
        "write done",
        "stop",
        "stop answered",
    ]
    summed = sum(one["left_out"]["lease taken"] for one in told if one["what"] == LEFT_OUT)
    written = sum(one["who"].startswith("ada") and one["what"] == "lease taken" for one in told)
    assert summed > 0
    assert summed + written == ENTRIES_AT_ONCE


def test_a_write_of_a_client_that_floods_is_refused_and_says_when_to_try_again(
    bench: Bench, tmp_path: Path
) -> None:
    with serving(config(tmp_path, KEPT)) as address, Client(address) as ada:
        ada.call("control.acquire", ttl_s=60)
        for _ in range(ENTRIES_AT_ONCE):
            ada.request("control.release")
            ada.answer(ada.request("control.acquire", ttl_s=60))
        refused = ada.refused("parameter.write", changes={"gait.cycle_time": 1.3})
    assert "nothing was written" in str(refused)
    assert "try again in" in str(refused)
    assert bench.gait.node.written() == []
