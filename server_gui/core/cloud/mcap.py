"""A session as MCAP with ROS 2 messages, for Foxglove, PlotJuggler and rosbag2."""

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Final

import msgspec
import pyarrow as pa

from ml.store.sessions import Session
from server_gui.core.atomic_files import draft
from server_gui.core.cloud.ros import definition, header
from server_gui.core.cloud.selection import Row, SelectedRecording
from server_gui.core.cloud.topics import Message, Topic, ros_name, topics
from server_gui.core.recording.batching import EventKind

if TYPE_CHECKING:
    from mcap.records import Schema
    from mcap_ros2.writer import Writer

EVENTS_TOPIC: Final = "/diagnostics"
_LEVELS: Final = {EventKind.MARKER.value: 0, EventKind.LOST.value: 2}  # of DiagnosticStatus; others are 1
_WARN: Final = 1
_EPOCH: Final = datetime(1970, 1, 1, tzinfo=UTC)


def write_mcap(file: Path, recording: SelectedRecording) -> int:
    """Telemetry as the topics of `topics`, events as diagnostics, labels as text; how many messages.

    The session is in the file's metadata, and so are the channels' units, which ROS's messages do not say.
    """
    from mcap_ros2.writer import Writer  # of an extra that a collector does not need

    robot = recording.session.robot
    with draft(file) as written, written.open("wb") as out, Writer(out) as writer:
        mcap = _Mcap(writer)
        writer.add_metadata("session", _texts(recording.session))
        writer.add_metadata("units", {each.name: each.unit or "" for each in recording.channels})
        for event in recording.events:
            mcap.write(EVENTS_TOPIC, "diagnostic_msgs/DiagnosticArray", _ns(event["utc"]), _diagnostic(event))
        for label in recording.labels:
            text = {"data": label["label"]}
            mcap.write(f"/{ros_name(robot)}/label", "std_msgs/String", _ns(label["utc"]), text)
        wanted = topics(robot, recording.channels)
        for table in recording.tables:
            mcap.write_rows(wanted, table)
    return mcap.written


class _Mcap:
    """Messages by topic; each kind's definition is written once."""

    def __init__(self, writer: "Writer") -> None:
        self.written = 0
        self._writer = writer
        self._schemas: dict[str, Schema] = {}

    def write(self, topic: str, kind: str, utc_ns: int, message: Message) -> None:
        schema = self._schemas.get(kind)
        if schema is None:
            name = kind.replace("/", "/msg/")
            schema = self._schemas[kind] = self._writer.register_msgdef(name, definition(kind))
        self._writer.write_message(topic, schema, message, log_time=utc_ns, sequence=self.written)
        self.written += 1

    def write_rows(self, wanted: Sequence[Topic], table: pa.Table) -> None:
        for row in table.to_pylist():
            utc_ns = _ns(row["utc"])
            for topic in wanted:
                if any(row[name] is not None for name in topic.channels):
                    self.write(topic.name, topic.kind, utc_ns, topic.message(utc_ns, row))


def _diagnostic(event: Row) -> Message:
    status = {
        "level": _LEVELS.get(event["kind"], _WARN),
        "name": event["kind"],
        "message": event["text"],
        "hardware_id": event["robot"],
        "values": [
            {"key": key, "value": str(value)}
            for key, value in msgspec.json.decode(event["data"] or b"{}").items()
        ],
    }
    return {"header": header(_ns(event["utc"]), ""), "status": [status]}


def _texts(session: Session) -> dict[str, str]:
    return {
        name: value if isinstance(value, str) else msgspec.json.encode(value).decode()
        for name, value in msgspec.to_builtins(session).items()
    }


def _ns(utc: datetime) -> int:
    return (utc - _EPOCH) // timedelta(microseconds=1) * 1000
