"""Every simulated sensor through its terminal or bus and our drivers: the channels say what is true."""

import json
import math
import random
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

from drivers.cli import listen, sensor
from drivers.imu import rotation
from hil_sim.clock import SECOND_NS
from hil_sim.gait.wearer import Foot
from hil_sim.sensors.faults import InsoleFaults
from hil_sim.sensors.sole import Sole
from hil_sim.sensors.suite import FEET, IMUS, INSOLES, SERIAL_IMUS, TRUNK, SensorChoice
from hil_sim.sensors.trunk_imu import quaternion, specific_force
from tests.support.waiting import until
from tests.unit.hil_sim.driven import STEP_NS, Bench, Watched, driven, steps_until

STEPS = 40
AXES = "xyz"
TILT = {"tilt_forward", "tilt_side"}
ORIENTATION = {f"orientation_{part}" for part in "wxyz"}
ACCELERATION = {f"acceleration_{axis}" for axis in AXES}
RATE = {f"angular_velocity_{axis}" for axis in AXES}
USUAL = TILT | ORIENTATION | ACCELERATION | RATE
SENT = {
    "witmotion": USUAL | {"temperature"},
    "bno08x-rvc": TILT | ORIENTATION | ACCELERATION,
    "xsens": USUAL | {"temperature"},
    "vectornav-binary": USUAL | {"temperature"},
    "cia410": TILT,
}
DESCRIBED = {"insole-csv": "insole-8", "insole-frame": "insole-18"}  # by a shipped layout


def near(found: Sequence[float], truth: Sequence[float], within: float) -> bool:
    return not found or list(found) == pytest.approx(list(truth), abs=within)


def moves_as(bench: Bench, trunk: Watched) -> bool:
    """Whether all that an IMU says of the last step is within its noise and resolution."""
    truth = bench.trunk
    side = -math.asin(math.sin(truth.roll) * math.cos(truth.pitch))
    attitude = quaternion(truth)
    turned = rotation.multiply(rotation.conjugate(quaternion(bench.trunk_before)), attitude)
    rate = [2 * part * SECOND_NS / STEP_NS for part in turned[1:]]
    said = trunk.of(*(f"orientation_{part}" for part in "wxyz"))
    return (
        near(trunk.of("tilt_forward", "tilt_side"), [truth.pitch, side], 1e-3)
        and near(said, [math.copysign(1.0, said[0]) * part for part in attitude] if said else [], 1e-3)
        and near(trunk.of(*(f"acceleration_{axis}" for axis in AXES)), specific_force(truth), 0.15)
        and near(trunk.of(*(f"angular_velocity_{axis}" for axis in AXES)), rate, 0.04)
        and near(trunk.of("temperature"), [31.5], 0.01)
    )


@pytest.mark.parametrize("imu", IMUS)
def test_a_trunk_imu_says_how_the_trunk_moves(imu: str, tmp_path: Path) -> None:
    with driven(tmp_path, SensorChoice(imu=imu)) as (bench, watched):
        trunk = watched[TRUNK]
        for _ in range(STEPS):
            bench.step()
            until(lambda: moves_as(bench, trunk), "what is true of this step")
        assert {quantity for quantity, value in trunk.values.items() if value is not None} == SENT.get(
            imu, USUAL
        )


def stands_as(insole: Watched, sole: Sole, foot: Foot) -> bool:
    """Whether force and centre of pressure are those of the cells' true pressures, within their noise."""
    forces = [pascal * cell.area for pascal, cell in zip(sole.pressures(foot), sole.cells, strict=True)]
    cop_x = sum(force * cell.x for force, cell in zip(forces, sole.cells, strict=True)) / foot.force
    cop_y = sum(force * cell.y for force, cell in zip(forces, sole.cells, strict=True)) / foot.force
    return near(insole.of("force"), [foot.force], 0.02 * foot.force + 3.0) and near(
        insole.of("cop_x", "cop_y"), [cop_x, cop_y], 0.004
    )


@pytest.mark.parametrize("language", INSOLES)
def test_an_insole_says_how_its_foot_stands(language: str, tmp_path: Path) -> None:
    cells = INSOLES[language][1]
    soles = [Sole(cells, side, InsoleFaults(), random.Random(0)) for side in (False, True)]
    with driven(tmp_path, SensorChoice(insole=language)) as (bench, watched):
        for _ in range(STEPS):
            bench.step()
            for name, sole, foot in zip(FEET, soles, bench.feet, strict=True):
                until(lambda: stands_as(watched[name], sole, foot), "what is true")  # noqa: B023
        share = bench.feet[0].force / sum(foot.force for foot in bench.feet)
        assert watched[FEET[0]].of("contact") == [1.0]
        assert watched[FEET[0]].of("load_share") == pytest.approx([share], abs=0.05)
        assert all(watched[name].problem == "" for name in FEET if watched[name].live)


@pytest.mark.parametrize("choice", [SensorChoice(), SensorChoice("xsens", "insole-csv")])
def test_a_sensor_that_was_unplugged_comes_back_with_its_banner_and_counts_anew(
    choice: SensorChoice, tmp_path: Path
) -> None:
    with driven(tmp_path, choice) as (bench, watched):
        for name, one in watched.items():
            bench.suite.faults[name].unplugged = True
            steps_until(bench, lambda: "does not exist" in one.problem)  # noqa: B023
            assert one.component.latest.read(0, 0) == (None, None)
            one.values.clear()
            bench.suite.faults[name].unplugged = False
            steps_until(bench, lambda: bool(one.values))  # noqa: B023
            assert one.counter("reconnects") >= 1
            assert one.counter("out_of_order") == 0


def test_a_wrong_baud_rate_is_named_and_no_value_is_made_of_it(tmp_path: Path) -> None:
    with driven(tmp_path, SensorChoice()) as (bench, watched):
        for name, one in watched.items():
            bench.suite.faults[name].wrong_baud = 57600
            steps_until(bench, lambda: "wrong baud rate" in one.problem)  # noqa: B023
            assert one.component.latest.read(0, one.component.latest.updated_ns or 0)[1] is not None
            bench.suite.faults[name].wrong_baud = None
            frames = one.counter("frames")
            steps_until(bench, lambda: one.counter("frames") > frames)  # noqa: B023


@pytest.mark.parametrize(
    ("imu", "insole"),
    [("witmotion", "insole-cobs"), ("xsens", "insole-frame"), ("vectornav-binary", "insole-cobs")],
)
def test_noise_on_a_line_with_checksums_costs_frames_and_makes_no_wrong_value(
    imu: str, insole: str, tmp_path: Path
) -> None:
    with driven(tmp_path, SensorChoice(imu, insole)) as (bench, watched):
        for faults in bench.suite.faults.values():
            faults.garbage_share, faults.dropout_share = 0.001, 0.05
        trunk, left = watched[TRUNK], watched[FEET[0]]
        for _ in range(3 * STEPS):
            bench.step()
            until(lambda: bench.fetched)
            assert all(-0.301 <= tilt <= 0.701 for tilt in trunk.of("tilt_forward"))
            assert all(0.0 <= force < 850.0 for force in left.of("force"))
        for one in watched.values():
            until(lambda: one.counter("bytes_dropped") > 0 and one.counter("frames") > STEPS)  # noqa: B023


@pytest.mark.parametrize(
    "choice",
    [
        SensorChoice("xsens", "insole-cobs"),
        SensorChoice("bno08x-rvc", "insole-csv"),
        SensorChoice("vectornav-binary"),
    ],
)
def test_counters_that_wrap_lose_no_frame(choice: SensorChoice, tmp_path: Path) -> None:
    with driven(tmp_path, choice) as (bench, watched):
        for faults in bench.suite.faults.values():
            faults.unplugged = faults.wraps_soon = True
        steps_until(bench, lambda: all("does not exist" in one.problem for one in watched.values()))
        for faults in bench.suite.faults.values():
            faults.unplugged = False
        for one in watched.values():
            one.values.clear()
        steps_until(bench, lambda: all(one.values for one in watched.values()))
        for _ in range(230):  # the counters wrap after 200
            bench.step()
            until(lambda: moves_as(bench, watched[TRUNK]), "what is true of this step")
        for one in watched.values():
            assert (one.counter("out_of_order"), one.counter("sequence_gaps")) == (0, 0)


# gwrms sensor


@contextmanager
def talking(bench: Bench) -> Iterator[None]:
    """The sensors send by themselves, about as often as in reality."""
    stop = threading.Event()

    def talk() -> None:
        while not stop.wait(STEP_NS / SECOND_NS):
            bench.step()

    thread = threading.Thread(target=talk)
    thread.start()
    try:
        yield
    finally:
        stop.set()
        thread.join()


@pytest.mark.parametrize(
    ("choice", "name", "found"),
    [
        *((SensorChoice(imu=imu), TRUNK, (imu.removesuffix("-binary"), None)) for imu in SERIAL_IMUS),
        *(
            pytest.param(
                SensorChoice(insole=name),
                foot,
                (name, DESCRIBED.get(name)),
                marks=[pytest.mark.nightly] * (foot is not FEET[number % 2]),  # one foot each by day
            )
            for number, name in enumerate(INSOLES)
            for foot in FEET
        ),
    ],
    ids=lambda value: f"{value.imu} {value.insole}" if isinstance(value, SensorChoice) else "",
)
def test_gwrms_sensor_finds_format_and_baud_rate_of_each_simulated_device(
    choice: SensorChoice,
    name: str,
    found: tuple[str, str | None],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(listen, "LISTEN_S", 0.5)
    bench = Bench(tmp_path, choice)
    # As long as the device's own time says, however late this computer lets it speak.
    monkeypatch.setattr(listen, "time", SimpleNamespace(monotonic=lambda: bench.clock.now_s))
    with talking(bench):
        assert sensor.main([str(tmp_path / name), "--json"]) == 0
    bench.close()
    heard = json.loads(capsys.readouterr().out)["found"]
    assert heard["baudrate"] == bench.suite.lines[name].baudrate
    assert (heard["match"]["format_name"], heard["match"]["layout"]) == found
    explained = heard["bytes"] * heard["match"]["share"]
    frame = explained / heard["match"]["frames"]
    assert heard["bytes"] - explained < 2.5 * frame, "the first and the last were cut, and no other"
    assert heard["match"]["feet"] == ([] if name == TRUNK else [name.removesuffix("_insole")])
