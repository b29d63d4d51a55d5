"""`gwrms store` and `gwrms restore`, and what is shown of parameters that are read-only."""

import json
from typing import Any

import pytest

from tests.unit.cli.served import Served, Terminal


@pytest.fixture
def storing(robot: Served) -> Served:
    node = robot.bench.left.node
    node.objects |= {(0x1010, 1): b"\1\0\0\0", (0x1011, 1): b"\1\0\0\0"}
    node.store = lambda index, data: b"\1\0\0\0" if index in (0x1010, 0x1011) else data
    return robot


def sent(robot: Served) -> list[tuple[int, Any]]:
    return robot.bench.left.node.written()


def test_store_takes_the_lease_and_says_what_was_done(
    storing: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    assert storing.run("store", "left_knee") == 0
    assert capsys.readouterr().out == "left_knee: stored, and it still holds the same values\n"
    assert sent(storing) == [(0x1010, b"save")]


@pytest.mark.parametrize(("answer", "status", "done"), [("yes\n", 0, [(0x1011, b"load")]), ("n\n", 1, [])])
def test_restore_asks_first(
    storing: Served,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    answer: str,
    status: int,
    done: list[tuple[int, bytes]],
) -> None:
    monkeypatch.setattr("sys.stdin", Terminal(answer))
    assert storing.run("restore", "left_knee") == status
    assert ("nothing was restored" in capsys.readouterr().err) is (status == 1)
    assert sent(storing) == done


def test_restore_with_yes_in_a_script(storing: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert storing.run("restore", "left_knee", "--yes", "--json") == 0
    assert json.loads(capsys.readouterr().out)["component"] == "left_knee"


def test_a_refused_store_is_a_sentence(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    assert robot.run("store", "left_insole") == 1
    assert "'left_insole' is no device that can store" in capsys.readouterr().err


def test_all_devices_store_and_each_says_what_came_of_it(
    storing: Served, capsys: pytest.CaptureFixture[str]
) -> None:
    """The right knee has the command and refuses; the exit status is no success then."""
    right = storing.bench.right.node
    right.objects |= {(0x1010, 1): b"\1\0\0\0"}
    storing.run("store", "--all", "--json")
    told = json.loads(capsys.readouterr().out)
    outcomes = {one["components"][0]: one["outcome"] for one in told}
    assert outcomes["left_knee"] == "stored"
    assert set(outcomes.values()) <= {"stored", "refused", "NOT CONFIRMED"}
    assert (0x1010, b"save") in sent(storing)


def test_store_wants_one_device_or_all(robot: Served, capsys: pytest.CaptureFixture[str]) -> None:
    for typed in (("store",), ("store", "left_knee", "--all")):
        with pytest.raises(SystemExit) as ended:
            robot.run(*typed)
        assert ended.value.code == 2
    assert "name one COMPONENT, or say --all" in capsys.readouterr().err
