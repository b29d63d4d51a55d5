"""An undo file that somebody has forged or damaged writes nothing but what the robot's file allows."""

import itertools
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from gateway.modules.stop.authority import Address
from gateway.records.undo import UndoFile
from tests.support.examples import examples
from tests.support.waiting import until
from tests.unit.gateway.harness import Bench
from tests.unit.gateway.test_left_behind import change, entry, write_undo
from tests.unit.gateway.tuned import (
    CYCLE,
    CYCLE_TIME,
    MAX_TORQUE,
    STEP,
    STEP_LENGTH,
    TOE,
    TOE_HEIGHT,
    TORQUE,
    held,
    tuned,
    u16,
)

NAMED: dict[str, Address] = {STEP_LENGTH: STEP, CYCLE_TIME: CYCLE, TOE_HEIGHT: TOE, MAX_TORQUE: TORQUE}
UNNAMED: tuple[Address, ...] = (
    ("main", 16, 0x1017, 0),
    ("main", 16, 0x2001, 1),
    ("main", 2, 0x6040, 0),
    ("main", 2, 0x6081, 0),
    ("main", 5, 0x6072, 0),
    ("other", 16, 0x2001, 0),
)
LEAST, MOST, STEP_MOST = 250, 600, 100  # of the step length, in the device's counts
HELD = 420

number = st.one_of(st.integers(0, 0xFFFF), st.integers(HELD - 200, HELD + 200))
otherwise = st.one_of(  # than it should be
    st.sampled_from(("gait.0x2001:0", "right_knee.max_torque", "left_knee.target", "tail.x", "", *NAMED)).map(
        lambda name: {"parameter": name}
    ),
    st.sampled_from((*NAMED.values(), *UNNAMED)).map(
        lambda where: dict(zip(("bus", "node_id", "index", "subindex"), where, strict=True))
    ),
    st.sampled_from(("gait", "left_knee", "right_knee", "")).map(lambda name: {"component": name}),
    st.sampled_from(("", "00", "a4010000", "0" * 16)).map(lambda raw: {"before": raw}),
    st.sampled_from(("", "ffff")).map(lambda raw: {"written": raw, "made": u16(HELD).hex()}),
)


@st.composite
def forged_change(draw: st.DrawFn) -> dict[str, Any]:
    """What was written is what the device holds, so that it is to be taken back."""
    name, address = draw(st.sampled_from(tuple(NAMED.items())))
    made = change(address, name, draw(number), HELD)
    for more in draw(st.lists(otherwise, max_size=2)):
        made |= more
    return made


forged = st.lists(
    st.builds(
        lambda write, changes, trial: entry(write, *changes, trial=trial),
        st.sampled_from((0, 7, 7, 8, (1 << 62) - 1)),
        st.lists(forged_change(), max_size=4),
        st.booleans(),
    ),
    max_size=3,
)
damage = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 8), st.binary(max_size=8)), max_size=3).flatmap(
    lambda places: st.sampled_from(([], [], places))
)


def damaged(text: bytes, places: list[tuple[float, int, bytes]]) -> bytes:
    for place, length, instead in places:
        at = int(place * len(text))
        text = text[:at] + instead + text[at + length :]
    return text


def hold(bench: Bench) -> None:
    """Every object on every node, those that no parameter names too."""
    for node in (bench.gait.node, bench.left.node, bench.right.node):
        node.log.clear()
    for _, node_id, index, subindex in (*NAMED.values(), *UNNAMED):
        holder = {16: bench.gait, 2: bench.left, 5: bench.right}[node_id].node
        holder.objects[index, subindex] = u16(HELD)


def check(bench: Bench) -> None:
    """Only what the robot's file names was written, and the step length within its limits and step."""
    assert bench.right.node.written() == []
    assert {index for index, _ in bench.gait.node.written()} <= {STEP[2], CYCLE[2], TOE[2]}
    assert {index for index, _ in bench.left.node.written()} <= {TORQUE[2]}
    for address in (one for one in UNNAMED if one[0] == "main"):  # there is but one bus
        assert held(bench, address) == HELD
    lengths = [
        HELD,
        *(
            int.from_bytes(data or b"", "little")
            for index, data in bench.gait.node.written()
            if index == STEP[2]
        ),
    ]
    assert all(LEAST <= length <= MOST for length in lengths)
    assert all(abs(after - before) <= STEP_MOST for before, after in itertools.pairwise(lengths))


@given(entries=forged, places=damage)
@settings(
    max_examples=examples(60),
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
def test_nothing_is_written_that_the_robots_file_does_not_allow(
    calm: Bench, tmp_path: Path, entries: list[dict[str, Any]], places: list[Any]
) -> None:
    hold(calm)
    shutil.rmtree(tmp_path / "state", ignore_errors=True)
    path = write_undo(tmp_path)
    path.write_bytes(damaged(json.dumps(entries).encode(), places))
    with tuned(tmp_path) as robot:
        until(lambda: all(trial.problem is not None for trial in robot.trials()), "each was tried")
    check(calm)


def test_a_forged_number_of_a_write_does_not_keep_the_next_from_being_written(
    calm: Bench, tmp_path: Path
) -> None:
    path = write_undo(tmp_path, entry((1 << 64) - 1, change(STEP, STEP_LENGTH, 400, 420)))
    with tuned(tmp_path) as robot:
        assert not path.exists()
        assert robot.told("undo file damaged")
        robot.write({STEP_LENGTH: 0.45})
    assert held(calm, STEP) == 450


@pytest.mark.parametrize("write", [-1, 1 << 62, (1 << 64) - 1, 1 << 70, 1.5])
def test_what_is_no_number_of_a_write_is_put_aside(tmp_path: Path, write: float) -> None:
    path = write_undo(tmp_path, entry(write, change(STEP, STEP_LENGTH, 400, 420)))  # type: ignore[arg-type]
    found, problem = UndoFile(path).load()
    assert (found, path.exists()) == ([], False)
    assert problem is not None
    assert "cannot be read" in problem
