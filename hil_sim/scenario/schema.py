"""Scenario files as a JSON Schema, from the tables that read them."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from hil_sim import operator
from hil_sim.exoskeleton import Scenario
from hil_sim.faults.registry import FAULTS
from hil_sim.gait.activity import Activity
from hil_sim.gait.walks import NAMES
from hil_sim.scenario.expect_table import COMPONENTS, STATES, SUBJECTS, TIMINGS
from hil_sim.scenario.expectation import When
from hil_sim.scenario.script import GATEWAY_LINES, ROBOT_KEYS
from hil_sim.scenario.truth import names
from hil_sim.sensors.suite import IMUS, INSOLES

Schema = dict[str, Any]
_TEXT: Final[Schema] = {"type": "string"}
_NUMBER: Final[Schema] = {"type": "number"}
_WHOLE: Final[Schema] = {"type": "integer"}
_TIME: Final[Schema] = {"type": "number", "minimum": 0, "description": "s since the robot was switched on"}
_WINDOW: Final[Schema] = {"type": "array", "items": _TIME, "minItems": 2, "maxItems": 2}


def _one_of(words: Iterable[str]) -> Schema:
    return {"enum": list(words)}


def _likely(words: Iterable[str]) -> Schema:
    """One of these, or a glob."""
    return {"anyOf": [_one_of(words), _TEXT]}


_ROBOT: Final[Mapping[str, Schema]] = {
    "scenario": _one_of(Scenario),
    "seconds": _TIME,
    "seed": _WHOLE,
    "subject": _WHOLE,
    "walks": _one_of(NAMES),
    "imu": _one_of(IMUS),
    "insole": _one_of(INSOLES),
    "drive": {"anyOf": [_TEXT, {"type": "array", "items": _TEXT}]},
}
_LINES: Final[Mapping[str, Schema]] = {
    "fault": _one_of(FAULTS),
    "clear": _one_of([*FAULTS, operator.EVERYTHING]),
    "activity": _one_of(one.lower() for one in Activity.__members__),
    "controller": _one_of(operator.CONTROLLER_COMMANDS),
    "list": {},
    "stop": _TEXT,
    "set": {"type": "object", "minProperties": 1},
}
_FURTHER: Final[Mapping[str, Schema]] = {
    "on": _likely(COMPONENTS),
    "for_s": _NUMBER,
    "params": {"type": "object"},
}
_SUBJECT: Final[Mapping[str, Schema]] = {"component": _likely(COMPONENTS), "truth": _likely(names())}
_CONDITIONS: Final[Mapping[str, Schema]] = {
    "state": _one_of(STATES),
    "min": _NUMBER,
    "max": _NUMBER,
    "missing": {"type": "boolean"},
    "tripped": {"type": "boolean"},
}


def schema() -> Schema:
    """Return all of it."""
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "scenario",
        **_table(
            {
                "title": _TEXT,
                "guard": {"type": "object"},  # what stands in it belongs to who reads robot.toml
                "robot": _table({key: _ROBOT[key] for key in ROBOT_KEYS}),
                "at": {"type": "array", "items": {"anyOf": [_line(key) for key in _LINES]}},
                "expect": {"type": "array", "items": {"anyOf": [_expected(key) for key in SUBJECTS]}},
            }
        ),
    }


def _table(properties: Mapping[str, Schema], required: Iterable[str] = ()) -> Schema:
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(required),
        "additionalProperties": False,
    }


def _line(key: str) -> Schema:
    further = () if key in GATEWAY_LINES else operator.further(key)
    more = {name: _FURTHER[name] for name in further}
    return _table({"time_s": _TIME, key: _LINES[key], **more}, ["time_s", key])


def _expected(subject: str) -> Schema:
    timings = {key: _TIME if when is When.AT else _WINDOW for key, when in TIMINGS.items()}
    asked = {key: _CONDITIONS.get(key, _TEXT) for key in SUBJECTS[subject]}
    return _table({subject: _SUBJECT.get(subject, _TEXT), **asked, **timings}, [subject])
