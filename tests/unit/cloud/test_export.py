"""Sessions as files that others read: CSV, Parquet, and MCAP as ROS 2 understands it."""

import csv
import errno
import json
import math
import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from ml.store import StoreError, StoreUnreachable
from ml.store.sessions import Channel, Session
from server_gui.core.atomic_files import draft
from server_gui.core.cloud import ros
from server_gui.core.cloud.mcap import write_mcap
from server_gui.core.cloud.recordings import Recorded as Opened
from server_gui.core.cloud.recordings import Recordings
from server_gui.core.cloud.selection import Choice, SelectedRecording, choose
from server_gui.core.cloud.tabular import write_csv, write_parquet
from tests.unit.cloud.recordings import BATCHES, ROWS, UNITS, Recorded, record
from tests.unit.recording.robots import value

WRITERS = {"csv": write_csv, "parquet": write_parquet, "mcap": write_mcap}
BEGAN = datetime(2026, 11, 21, 15, 30, tzinfo=UTC)


def chosen(url: str, spool: Path, choice: Choice | None = None) -> SelectedRecording:
    recorded = record(url, spool)
    return choose(*opened(recorded), choice or Choice())


def opened(recorded: Recorded) -> tuple[Recordings, Opened]:
    known = Recordings(recorded.store.url, recorded.spool)
    return known, known.open(known.find(recorded.session))


def test_csv_has_units_in_its_header_and_every_row(store_url: str, tmp_path: Path) -> None:
    file = tmp_path / "walk.csv"
    assert write_csv(file, chosen(store_url, tmp_path / "spool")) == BATCHES * ROWS
    header, *rows = csv.reader(file.read_text(encoding="utf-8").splitlines())
    assert header == ["utc", "stamp_ns [ns]", *(f"{name} [{unit}]" for name, unit in UNITS.items())]
    assert len(rows) == BATCHES * ROWS
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{6}Z", rows[0][0])  # as in gwrms watch --csv
    found = sorted(float(row[2]) for row in rows)
    assert found == sorted(value(seq, row, 0) for seq in range(21) if seq != 10 for row in range(ROWS))


def test_parquet_has_units_and_the_session_in_its_metadata(folder_url: str, tmp_path: Path) -> None:
    file = tmp_path / "walk.parquet"
    recording = chosen(folder_url, tmp_path / "spool", Choice(("left_knee.*",)))
    assert write_parquet(file, recording) == BATCHES * ROWS
    schema = pq.read_schema(file)
    units = {each.name: (each.metadata or {}).get(b"unit") for each in schema}
    assert units == {
        "utc": None, "stamp_ns": b"ns", "left_knee.position": b"rad", "left_knee.velocity": b"rad/s"
    }  # fmt: skip
    assert json.loads(schema.metadata[b"session"])["operator"] == "anna"
    assert pq.read_table(file)["left_knee.position"].null_count == 0


def test_mcap_is_read_as_ros_2_reads_it(folder_url: str, tmp_path: Path) -> None:
    file = tmp_path / "walk.mcap"
    write_mcap(file, chosen(folder_url, tmp_path / "spool"))
    messages = read(file)
    joints = messages["/exo_01/joint_states"]
    assert len(joints) == BATCHES * ROWS
    assert [list(each.name) for _, each in joints] == [["left_knee"]] * len(joints)
    assert sorted(each.position[0] for _, each in joints) == sorted(
        value(seq, row, 0) for seq in range(21) if seq != 10 for row in range(ROWS)
    )
    for stamp_ns, each in joints:
        assert each.header.stamp.sec * 10**9 + each.header.stamp.nanosec == stamp_ns
        assert each.velocity[0] == each.position[0] + 1
        assert len(each.effort) == 0
    statuses = [each.status[0] for _, each in messages["/diagnostics"]]
    assert sorted((each.name, each.level, each.hardware_id) for each in statuses) == [
        ("gap", 1, "exo-01"), ("marker", 0, "exo-01")
    ]  # fmt: skip
    assert [each.data for _, each in messages["/exo_01/label"]] == ["walk"]
    with file.open("rb") as opened:
        metadata = {each.name: each.metadata for each in make_reader(opened).iter_metadata()}
    assert metadata["session"]["robot"] == "exo-01"
    assert metadata["units"] == UNITS


SENSORS = {
    **{f"trunk.acceleration_{axis}": "m/s²" for axis in "xyz"},
    **{f"trunk.angular_velocity_{axis}": "rad/s" for axis in "xyz"},
    "trunk.temperature": "°C",
    **{f"left_insole.cell_{cell}": "Pa" for cell in (0, 10, 2)},
    "left_insole.force": "N",
    "left_hip.position": "rad",
    "right_hip.position": "rad",
    "right_hip.torque": "N·m",
    "2nd.pressure": "Pa",
}


def sensed(*rows: dict[str, float]) -> SelectedRecording:
    """Of every kind of sensor, a row a second; what is not given is null."""
    columns = {name: [row.get(name) for row in rows] for name in SENSORS}
    utc = [BEGAN + timedelta(seconds=number) for number in range(len(rows))]
    table = pa.table({"utc": utc, "stamp_ns": list(range(len(rows)))} | columns)
    channels = [Channel(name, unit, len(rows)) for name, unit in SENSORS.items()]
    return SelectedRecording(Session("exo-01", "s-1"), channels, [table], [], [])


def test_each_sensor_has_its_message(tmp_path: Path) -> None:
    file = tmp_path / "all.mcap"
    write_mcap(file, sensed({name: float(number) for number, name in enumerate(SENSORS)}))
    messages = {topic: found for topic, [(_, found)] in read(file).items()}
    imu = messages["/exo_01/trunk/imu"]
    assert (imu.linear_acceleration.x, imu.linear_acceleration.z, imu.angular_velocity.y) == (0, 2, 4)
    assert imu.orientation_covariance[0] == -1  # it has none
    assert imu.linear_acceleration_covariance[0] == 0
    assert messages["/exo_01/trunk/temperature"].temperature == 6
    cells = messages["/exo_01/left_insole/cells"]
    assert list(cells.data) == [7, 9, 8]  # in the order of their numbers
    assert (cells.layout.dim[0].label, cells.layout.dim[0].size) == ("cell", 3)
    assert messages["/exo_01/left_insole/force"].data == 10
    joints = messages["/exo_01/joint_states"]
    assert (list(joints.name), list(joints.position)) == (["left_hip", "right_hip"], [11, 12])
    assert math.isnan(joints.effort[0])
    assert joints.effort[1] == 13
    assert messages["/exo_01/_2nd/pressure"].fluid_pressure == 14
    assert len(messages) == 6


def test_what_is_missing_is_no_message_or_nan_and_never_zero(tmp_path: Path) -> None:
    file = tmp_path / "few.mcap"
    write_mcap(
        file, sensed({"left_insole.cell_2": 3.0}, {"left_hip.position": 1.0}, {"trunk.acceleration_x": 1.0})
    )
    messages = read(file)
    assert set(messages) == {"/exo_01/left_insole/cells", "/exo_01/joint_states", "/exo_01/trunk/imu"}
    [(_, cells)] = messages["/exo_01/left_insole/cells"]
    assert [math.isnan(each) for each in cells.data] == [True, False, True]
    [(_, joints)] = messages["/exo_01/joint_states"]
    assert [math.isnan(each) for each in joints.position] == [False, True]
    [(_, imu)] = messages["/exo_01/trunk/imu"]
    assert imu.linear_acceleration_covariance[0] == -1  # two of its axes are not known


@pytest.mark.parametrize(
    "kind",
    [
        "sensor_msgs/JointState", "sensor_msgs/Imu", "sensor_msgs/FluidPressure", "sensor_msgs/Temperature",
        "std_msgs/Float64", "std_msgs/Float64MultiArray", "std_msgs/String",
        "diagnostic_msgs/DiagnosticArray",
    ],
)  # fmt: skip
def test_messages_are_defined_as_ros_2_defines_them(kind: str) -> None:
    known = get_typestore(Stores.ROS2_HUMBLE).fielddefs
    found = get_types_from_msg(ros.definition(kind), kind.replace("/", "/msg/"))
    assert {name: fields for name, (_, fields) in found.items()} == {name: known[name][1] for name in found}


@pytest.mark.parametrize("kind", WRITERS)
def test_an_export_that_breaks_off_leaves_what_was_there(tmp_path: Path, kind: str) -> None:
    file = tmp_path / f"walk.{kind}"
    file.write_text("before")
    recording = sensed({"trunk.temperature": 1.0})

    def broken() -> Iterator[pa.Table]:
        yield from recording.tables
        raise KeyboardInterrupt

    cut = SelectedRecording(recording.session, recording.channels, broken(), [], [])
    with pytest.raises(KeyboardInterrupt):
        WRITERS[kind](file, cut)
    assert [each.name for each in tmp_path.iterdir()] == [file.name]
    assert file.read_text() == "before"


def test_a_disk_that_is_full_is_told_with_the_files_name(tmp_path: Path) -> None:
    full = OSError(errno.ENOSPC, "Error writing bytes to file")
    for error, words in (
        (full, "walk.csv cannot be written: No space left"),
        (StoreUnreachable("away"), "away"),
    ):
        with pytest.raises(OSError, match=words), draft(tmp_path / "walk.csv"):
            raise error
    assert list(tmp_path.iterdir()) == []


def test_a_choice_takes_channels_by_glob_and_refuses_one_that_means_none(
    folder_url: str, tmp_path: Path
) -> None:
    recorded = record(folder_url, tmp_path / "spool")
    known, whole = opened(recorded)
    session = whole.session
    some = choose(known, whole, Choice(("*.position", "trunk.tilt_forward")))
    assert [each.name for each in some.channels] == ["left_knee.position", "trunk.tilt_forward"]
    with pytest.raises(StoreError, match="no channel 'right_"):
        choose(known, whole, Choice(("right_*",)))
    assert session.last is not None
    late = session.last + timedelta(hours=1)
    for nothing in (Choice(begin=late), Choice(end=session.first), Choice(begin=late, end=session.last)):
        with pytest.raises(StoreError, match=r"has nothing from .*: it goes from .* UTC, \d+ s"):
            choose(known, whole, nothing)


def read(file: Path) -> dict[str, list[tuple[int, Any]]]:
    """Stamp and message by topic, by another library than the one that wrote it."""
    found: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([file]) as reader:
        for connection, stamp_ns, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            found.setdefault(connection.topic, []).append((stamp_ns, message))
    return found
