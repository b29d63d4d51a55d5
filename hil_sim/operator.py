"""Requests to a running robot: a fault, an activity, a start. One request, one answer."""

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any

from hil_sim import controller
from hil_sim.bench_user import FEET
from hil_sim.errors import SimulatorError
from hil_sim.exoskeleton import JOINTS, Exoskeleton
from hil_sim.faults.injector import Faults, check_fault, find
from hil_sim.faults.registry import FAULTS
from hil_sim.gait.activity import Activity
from hil_sim.gait.timetable import Entry

Request = Mapping[str, Any]
Answer = dict[str, Any]

EVERYTHING = "all"
NOBODY = "nobody"
CONTROLLER_COMMANDS = {"start": b"\x01", "stop": b"\x00"}  # object 2000h


class RequestRefused(SimulatorError):
    """A request that is none; the message says what one looks like."""


class Operator:
    """Does what requests say, in the thread that runs the robot's clock."""

    def __init__(self, robot: Exoskeleton, faults: Faults) -> None:
        self._robot = robot
        self._faults = faults
        self._verbs: dict[str, Callable[[Request], Answer]] = {
            "fault": self._fault,
            "clear": self._clear,
            "activity": self._activity,
            "controller": self._controller,
            "hand": self._hand,
            "lean": self._lean,
            "stamp": self._stamp,
            "list": self._list,
        }

    def obey(self, request: object) -> Answer:
        """Do one thing and say what was done; raises `SimulatorError`."""
        checked = check(request)
        return self._verbs[verb_of(checked)](checked)

    def _fault(self, request: Request) -> Answer:
        name, on, for_s, params = (request.get(key) for key in ("fault", "on", "for_s", "params"))
        return {"begun": asdict(self._faults.begin(str(name), on, for_s, params))}

    def _clear(self, request: Request) -> Answer:
        name = None if request["clear"] == EVERYTHING else request["clear"]
        return {"cleared": [asdict(active) for active in self._faults.clear(name, request.get("on"))]}

    def _activity(self, request: Request) -> Answer:
        self._robot.follow([Entry(Activity[request["activity"].upper()])])
        return {"activity": request["activity"]}

    def _controller(self, request: Request) -> Answer:
        self._robot.controller.dictionary.write(
            *controller.COMMAND, CONTROLLER_COMMANDS[request["controller"]]
        )
        return {"controller": self._robot.controller.controller_state.name.lower()}

    def _hand(self, request: Request) -> Answer:
        joint, degrees = str(request["hand"]), float(request["degrees"])
        drive = self._robot.drives[joint]
        self._robot.hands.move(drive, self._robot.mountings[joint], math.radians(degrees))
        return {"hand": joint, "degrees": degrees}

    def _lean(self, request: Request) -> Answer:
        forward, left = (math.radians(degrees) for degrees in request["lean"])
        self._robot.hands.lean = (forward, left)
        return {"lean": request["lean"]}

    def _stamp(self, request: Request) -> Answer:
        self._robot.hands.stamping = None if request["stamp"] == NOBODY else str(request["stamp"])
        return {"stamp": request["stamp"]}

    def _list(self, _request: Request) -> Answer:
        """Return every fault with its keys and where it is on now, and those that are on."""
        active = self._faults.active
        faults = {
            name: fault.facts | {"active": [one.on for one in active if one.name == name]}
            for name, fault in FAULTS.items()
        }
        return {"active": [asdict(one) for one in active], "faults": faults}


def verb_of(request: Request) -> str:
    """Return the request's verb; raises `RequestRefused`."""
    verbs = [verb for verb in _CHECKS if verb in request]
    if len(verbs) != 1:
        raise RequestRefused(f"say one of {', '.join(_CHECKS)}, not {', '.join(request) or 'nothing'}")
    return verbs[0]


def further(verb: str) -> tuple[str, ...]:
    """Return the further keys of a request of this kind."""
    return _CHECKS[verb][0]


def check(request: object) -> Request:
    """Return the request, where it can be obeyed as far as anybody can tell; raises `SimulatorError`."""
    if not isinstance(request, Mapping):
        raise RequestRefused('a request is an object like {"fault": "node_lost", "on": "left_knee"}')
    verb = verb_of(request)
    further, check_this = _CHECKS[verb]
    for key in request:
        if key not in (verb, *further):
            allowed = ", ".join(further) or "no other key"
            raise RequestRefused(f"{key!r} does not belong to {verb!r}, which takes {allowed}")
    check_this(request)
    return request


def _check_fault(request: Request) -> None:
    params = request.get("params", {})
    if not isinstance(params, Mapping):
        raise RequestRefused(f"params = {params!r} is no table of parameters and values")
    check_fault(request["fault"], request.get("on"), request.get("for_s"), params)


def _check_clear(request: Request) -> None:
    if request["clear"] != EVERYTHING:
        find(request["clear"])


def _check_activity(request: Request) -> None:
    names = [name.lower() for name in Activity.__members__]
    if request["activity"] not in names:
        raise RequestRefused(f"there is no activity {request['activity']!r}: {', '.join(names)}")


def _check_controller(request: Request) -> None:
    if request["controller"] not in list(CONTROLLER_COMMANDS):
        raise RequestRefused(
            f"controller = {request['controller']!r} is no command: {', '.join(CONTROLLER_COMMANDS)}"
        )


def _check_hand(request: Request) -> None:
    if request["hand"] not in JOINTS:
        raise RequestRefused(f"there is no joint {request['hand']!r}: {', '.join(JOINTS)}")
    _check_degrees("degrees", request.get("degrees"))


def _check_lean(request: Request) -> None:
    lean = request["lean"]
    if not isinstance(lean, list) or len(lean) != 2:
        raise RequestRefused(f"lean = {lean!r} is not [forward, left], in degrees")
    for degrees in lean:
        _check_degrees("lean", degrees)


def _check_degrees(key: str, degrees: object) -> None:
    if not isinstance(degrees, int | float) or isinstance(degrees, bool) or not abs(degrees) <= 180:
        raise RequestRefused(f"{key} = {degrees!r} is no number of degrees, -180 to 180")


def _check_stamp(request: Request) -> None:
    if request["stamp"] not in (*FEET, NOBODY):
        raise RequestRefused(f"stamp = {request['stamp']!r} is none of {', '.join(FEET)}, {NOBODY}")


def _nothing_to_check(_request: Request) -> None:
    """Every value will do."""


# verb → what else its request may hold, and what is wrong with it
_CHECKS: Mapping[str, tuple[tuple[str, ...], Callable[[Request], None]]] = {
    "fault": (("on", "for_s", "params"), _check_fault),
    "clear": (("on",), _check_clear),
    "activity": ((), _check_activity),
    "controller": ((), _check_controller),
    "hand": (("degrees",), _check_hand),
    "lean": ((), _check_lean),
    "stamp": ((), _check_stamp),
    "list": ((), _nothing_to_check),
}

VERBS = tuple(_CHECKS)
