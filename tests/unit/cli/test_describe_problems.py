"""The last line of `gwrms describe` counts what is wrong above it, and names each place once."""

from typing import Any

import msgspec
import pytest

from gateway.cli.describe_problems import summary
from gateway.wire.component import ComponentInfo
from gateway.wire.robot import Description, GuardInfo, GuardRuleInfo
from gateway.wire.stop import StopInfo
from tests.unit.cli.test_describe_buses import BUS, FULL, KNEE, NODE, SILENT, described

WELL = ComponentInfo("left_knee", "joint", "ok")
QUIET = msgspec.structs.replace(BUS, findings=[], nodes=[msgspec.structs.replace(NODE, findings=[])])
STOP = StopInfo(held=False, reason=None, since_ns=None, stopped_again={}, drives={})


def rule(state: str) -> GuardRuleInfo:
    return GuardRuleInfo("hot", "temperature", "above 80", [], [], "alarm", state, 0, None, 0, [])


def robot(**changed: Any) -> Description:
    return msgspec.structs.replace(described(), **({"components": [WELL], "buses": [QUIET]} | changed))


@pytest.mark.parametrize(
    ("changed", "line"),
    [
        ({}, "no problem found"),
        ({"components": [KNEE]}, "1 problem: left_knee"),
        ({"buses": [msgspec.structs.replace(BUS, findings=[FULL])]}, "2 problems: bus main, left_knee"),
        ({"components": [KNEE], "buses": [BUS]}, "2 problems: left_knee, bus main"),
        ({"buses": [msgspec.structs.replace(QUIET, strangers=[9])]}, "1 problem: bus main"),
        (
            {"buses": [msgspec.structs.replace(QUIET, nodes=[msgspec.structs.replace(NODE, components=[])])]},
            "1 problem: main node 2",
        ),
        ({"stop": msgspec.structs.replace(STOP, held=True)}, "1 problem: a stop is held"),
        ({"stop": msgspec.structs.replace(STOP, controllers={"gait": "no object"})}, "1 problem: stop"),
        ({"guard": GuardInfo(configured=True, problem="no bus")}, "1 problem: guard"),
        ({"guard": GuardInfo(configured=True, rules=[rule("blind")])}, "1 problem: guard rule hot"),
        ({"guard": GuardInfo(configured=True, rules=[rule("watching")])}, "no problem found"),
    ],
)
def test_each_place_with_a_problem_is_named_once(changed: dict[str, Any], line: str) -> None:
    assert SILENT in NODE.findings
    assert summary(robot(**changed)) == f"{line}\n"


def test_a_controller_that_is_held_is_a_problem() -> None:
    assert summary(robot(), ["gait.controller_state"]) == "1 problem: gait.controller_state\n"
