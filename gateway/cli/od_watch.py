"""`gwrms od … --watch`: what a device holds, a line for each object whenever it holds something else."""

import itertools
import threading
import time
from collections.abc import Iterator
from typing import Final

from gateway.cli.text import say, say_json
from gateway.client import ClientError, Robot
from gateway.wire.dictionary import ObjectInfo, ObjectList, ObjectValue
from gateway.wire.limits import OBJECTS_READ

PERIOD_S: Final = 1.0  # between two looks


class TooMany(ClientError):
    """More objects than one question may have."""


def watch(robot: Robot, found: ObjectList, count: int | None, *, as_json: bool) -> int:
    """Watch until Ctrl-C, or so many lines; return the exit status."""
    if found.left_off or len(found.objects) > OBJECTS_READ:
        total = len(found.objects) + found.left_off
        raise TooMany(f"{total} objects are too many to watch, {OBJECTS_READ} at most: search for less")
    try:
        for info, value in itertools.islice(_changes(robot, found), count):
            if as_json:
                say_json({"object": info.object, "name": info.name, "value": value})
            else:
                said = value.problem or value.words
                say(f"{time.strftime('%H:%M:%S')}  {info.object:<10} {info.name}: {said}\n")
    except KeyboardInterrupt:
        return 0  # how a watch ends
    return 0


def _changes(robot: Robot, found: ObjectList) -> Iterator[tuple[ObjectInfo, ObjectValue]]:
    before: dict[str, tuple[object, str | None]] = {}
    pause = threading.Event()
    while True:
        values = robot.read_objects(found.component, *(info.object for info in found.objects)).values
        for info in found.objects:
            value = values[info.object]
            if before.get(info.object) != (value.value, value.problem):
                yield info, value
            before[info.object] = value.value, value.problem
        pause.wait(PERIOD_S)
