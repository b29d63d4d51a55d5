"""Sessions, labels, resources and journals as rows for the store."""

import time
import uuid
from collections.abc import Mapping
from datetime import UTC, datetime
from typing import Any, Final

import msgspec

from gateway.wire.control import SignedHead
from gateway.wire.resource import ResourceSnapshot
from ml.store.labels import Label
from server_gui.core.recording.rows import Record

RECORDER: Final = "gwrms collect"  # among the versions of a session: whose rows these are
MORE: Final = ("disk", "network", "thermal", "throttling", "kernel")  # of a snapshot, in one column


class Worn(msgspec.Struct, frozen=True):
    """Wearer of the robot, by the study's name, and the consent."""

    wearer: str = ""
    consent: str = ""


NOBODY: Final = Worn()


class Facts(msgspec.Struct, frozen=True):
    """Facts at the start of a session.

    `parameters` are values by name, `units` each channel's unit, `versions` software by name. `setup` is
    what else was so, by section and name, as in `firmware/left_knee`; what is not in it was not told.
    """

    configuration_hash: str = ""
    parameters: dict[str, float | int | None] = {}
    units: dict[str, str] = {}
    versions: dict[str, str] = {}
    operator: str = ""
    notes: str = ""
    worn: Worn = NOBODY
    setup: dict[str, str | float] = {}


class Session(msgspec.Struct, frozen=True):
    """A stretch of one robot's recording. Of several rows with one name in the store, the last holds."""

    robot: str
    name: str
    began_utc_ns: int
    facts: Facts
    ended_utc_ns: int | None = None

    def record(self) -> Record:
        """Return it as a row of the table `sessions`."""
        facts = self.facts
        fields = {
            "robot": self.robot,
            "session": self.name,
            "utc": time.time_ns(),
            "began": self.began_utc_ns,
            "ended": self.ended_utc_ns,
            "configuration_hash": facts.configuration_hash,
            "parameters": _json(facts.parameters),
            "units": _json(facts.units),
            "versions": _json(facts.versions),
            "operator": facts.operator,
            "notes": facts.notes,
            "wearer": facts.worn.wearer,
            "consent": facts.worn.consent,
            "setup": _json(facts.setup),
        }
        return Record("sessions", fields)

    def amended(self, facts: Facts) -> "Session":
        """Return the same session, of which more is known now."""
        return msgspec.structs.replace(self, facts=facts)

    def ended(self, utc_ns: int) -> "Session":
        """Return the same session, ended at this time; never before it began."""
        return msgspec.structs.replace(self, ended_utc_ns=max(self.began_utc_ns, utc_ns))


def begin(robot: str, facts: Facts) -> Session:
    """Return a session that begins now; its name sorts by time."""
    now_ns = time.time_ns()
    name = f"{datetime.fromtimestamp(now_ns / 1e9, UTC):%Y%m%dT%H%M%SZ}-{uuid.uuid4().hex[:6]}"
    return Session(robot, name, now_ns, facts)


def label(label: Label, *, removed: bool = False) -> Record:
    """Return a row of `labels`: that the label holds, or holds no more."""
    return Record("labels", label.row(time.time_ns(), removed=removed))


def resources(robot: str, session: str, utc_ns: int, snapshot: ResourceSnapshot) -> Record:
    """Return a row of `resources`: the robot's computer, with its processes."""
    found = msgspec.to_builtins(snapshot)
    cpu, memory, gateway = found["cpu"], found["memory"], found["gateway"]
    more = {key: found[key] for key in MORE if key in found}
    fields = {
        "robot": robot,
        "session": session,
        "utc": utc_ns,
        "stamp_ns": found["stamp_ns"],
        "cpu_percent": cpu["percent"],
        "cpu_percent_per_core": cpu["per_core"],
        "load": cpu["load"],
        **{f"memory_{name}": value for name, value in memory.items()},
        "gateway_cpu_percent": gateway["cpu_percent"],
        "gateway_rss": gateway["rss_bytes"],
        "processes": [{"cmdline": None, **process} for process in found.get("processes", ())],
        "more": _json(more),
    }
    return Record("resources", fields)


def journal(robot: str, entry: Mapping[str, Any], head: SignedHead | None = None) -> Record:
    """Return a row of `journal`: one entry of the robot's own journal, whole, with its hash.

    `head` is the same as the robot has signed it.
    """
    fields = {
        "robot": robot,
        "utc": entry.get("utc_ns"),
        "n": entry["n"],
        "hash": entry["hash"],
        "who": entry.get("who"),
        "what": entry.get("what"),
        "entry": _json(dict(entry)),
        "witness": None if head is None else _json(msgspec.to_builtins(head)),
    }
    return Record("journal", fields)


def _json(value: dict[str, Any]) -> str:
    return msgspec.json.encode(value).decode()
