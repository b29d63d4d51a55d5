"""STOP while a robot is commissioned: quick stop to every drive that is known, and what each confirms.

Like every stop it can enable nothing (`drivers.joint.commands`). It is software, not an emergency stop.
"""

import threading
import time
from collections.abc import Collection, Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Annotated

import msgspec

from drivers.bus.sdo.protocol import expedited
from drivers.errors import DriverError
from drivers.joint.axis import Axis as SdoAxis
from drivers.joint.commands import CONTROLWORD, STATUSWORD, STOPPED_STATES, Controlword
from drivers.joint.quantities import AXIS_OFFSET
from drivers.joint.quick_stop import StopOutcome, Stopping
from gateway.commission.axes import Axis
from gateway.commission.bench import CanBench
from gateway.commission.draft import MOST_AXES, Draft
from gateway.tables.reading import Unreadable, parse

WITHIN_S = 1.5  # for a drive to confirm it
ANSWER_S = 0.5  # for a node that was asked without being known, to answer
NO_DRIVE = "the robot's file has no drive"
NONE_KNOWN = "no drive is known yet; all 127 node ids were asked to stop"
OTHERS = "draft and robot's file do not tell of every drive: others may be on the bus"
UNREADABLE = "cannot be read, so no drive is known for sure; all 127 node ids were asked to stop"
EVERY_NODE = range(1, 128)
_NODE_NAMES = frozenset(map(str, EVERY_NODE))
_ABOUT = CONTROLWORD.to_bytes(2, "little") + b"\0"
_ABORT, _NO_OBJECT = 0x80, 0x0602_0000.to_bytes(4, "little")  # CiA 301 §7.2.4.3.17


class _Joint(msgspec.Struct):
    node_id: Annotated[int, msgspec.Meta(ge=1, le=127)]
    axis: Annotated[int, msgspec.Meta(ge=0, lt=MOST_AXES)] = 0


class _File(msgspec.Struct):
    joint: dict[str, _Joint] = {}


@dataclass(frozen=True, slots=True)
class DriveStopped:
    """What is known of one drive after a stop, and when it was: after the request was sent."""

    outcome: StopOutcome
    state: str | None = None  # in words, as it has said last; None: it has said nothing
    after_ms: float | None = None  # until it was confirmed; None: it was not


UNREACHED = DriveStopped(StopOutcome.UNREACHABLE)


@dataclass(frozen=True, slots=True)
class Stopped:
    """Result of a stop by drive; of no drives while none is known."""

    drives: Mapping[str, StopOutcome]
    problem: str = ""  # of the bus, or why there may be other drives
    states: Mapping[str, str] = field(default_factory=dict)  # of drives that have said theirs
    after_ms: Mapping[str, float] = field(default_factory=dict)  # of drives that have confirmed it
    joints: Mapping[str, str] = field(default_factory=dict)  # of drives whose joint has a name

    @classmethod
    def of(
        cls, found: Mapping[str, DriveStopped], problem: str = "", joints: Mapping[str, str] | None = None
    ) -> "Stopped":
        """Return the result from what is known of each drive, and the names of their `joints`."""
        return cls(
            {name: one.outcome for name, one in found.items()},
            problem,
            {name: one.state for name, one in found.items() if one.state is not None},
            {name: one.after_ms for name, one in found.items() if one.after_ms is not None},
            joints or {},
        )

    @property
    def confirmed(self) -> bool:
        return bool(self.drives) and not self.problem and not self._missing

    @property
    def words(self) -> str:
        if not self.drives:
            return f"NOT CONFIRMED: {self.problem or NONE_KNOWN}"
        if self.confirmed:
            return f"STOP is confirmed by {', '.join(self.drives)}"
        missing = ", ".join(self._missing)
        if not missing:
            return f"NOT CONFIRMED: {self.problem}; only {', '.join(self.drives)} confirmed it"
        return f"NOT CONFIRMED: {missing}" + (f" ({self.problem})" if self.problem else "")

    @property
    def _missing(self) -> list[str]:
        said = self.drives.items()
        return [f"{axis} is {outcome}" for axis, outcome in said if outcome != StopOutcome.CONFIRMED]


def stop(bench: CanBench, draft: Draft) -> Stopped:
    """Ask all at once, then look until each has confirmed; where no drive is known all node ids are asked.

    Known are those that were found until now, and the joints of the robot's file. While there is a draft all
    node ids are asked, too: it may not tell of every drive. Whoever answers is looked at. Nothing that a file
    says, or a folder that is gone, keeps the stop from going out.

    Raises:
        DriverError: the bus does not open.

    """
    drafted, written = set(axes_of(draft)), _joints_in(draft.file)
    known = drafted | (written or {}).keys()
    is_draft = bool(draft.tables) or _may_exist(draft.path)
    found = _stopped(bench, known, every=is_draft or not known)
    is_open = (is_draft and not drafted) or written is None
    problem = OTHERS if is_open else ""
    if not known:
        problem = NONE_KNOWN if written is not None else f"{draft.file} {UNREADABLE}"
    names = {str(axis): name for axis, name in ((written or {}) | _joints_of(draft)).items()}
    return Stopped.of({str(axis): one for axis, one in found.items()}, problem, names)


def stop_all(buses: Mapping[str, tuple[CanBench, Mapping[Axis, str]]]) -> Stopped:
    """Stop the drives of several buses, all at once: one that is dead keeps no other waiting.

    Each drive comes with its joint. Those of a bus that does not open, or fails meanwhile, are not reached.
    """
    if not buses:
        return Stopped({}, NO_DRIVE)
    drives: dict[str, DriveStopped] = {}
    joints: dict[str, str] = {}
    problems: list[str] = []
    with ThreadPoolExecutor(len(buses), "stop") as pool:
        stopping = {name: pool.submit(_stopped, *of) for name, of in buses.items()}
    for name, future in stopping.items():
        try:
            found = future.result()
        except DriverError as error:
            problems.append(str(error))
            found = dict.fromkeys(buses[name][1], UNREACHED)
        except OSError as error:  # of the interface, below the driver
            problems.append(f"{name}: {error.strerror or error}")
            found = dict.fromkeys(buses[name][1], UNREACHED)
        where = f" on {name}" if len(buses) > 1 else ""
        drives |= {f"{axis}{where}": one for axis, one in found.items()}
        joints |= {f"{axis}{where}": joint for axis, joint in buses[name][1].items()}
    return Stopped.of(drives, "; ".join(problems), joints)


def _stopped(bench: CanBench, known: Collection[Axis], *, every: bool = False) -> dict[Axis, DriveStopped]:
    """Stop what is `known`, and with `every` whoever answers that was not."""
    sent_ns: dict[Axis, int] = {}
    answered: set[int] = set()
    others = [axis for axis in map(Axis, EVERY_NODE) if axis not in known] if every else []
    with bench.listening(partial(_note, answered)):
        for axis in (*sorted(known, key=_place), *others):
            sent_ns[axis] = time.monotonic_ns()
            bench.send_urgent(axis.node, _request(axis))
        found = _confirmed(bench, known, sent_ns)
        if others:
            _ask_again(bench, [axis for axis in others if axis.node not in answered])
    found |= _confirmed(bench, [axis for axis in others if axis.node in answered], sent_ns)
    further = [axis for axis in _further(bench, found) if axis not in found]
    return found | _confirmed(bench, further, sent_ns)


def _note(answered: set[int], node: int, data: bytes) -> None:
    """Note a node that answers to its controlword, in whichever way but that it has none: no drive."""
    if data[1:4] == _ABOUT and (data[0], data[4:8]) != (_ABORT, _NO_OBJECT):
        answered.add(node)


def _ask_again(bench: CanBench, silent: Iterable[Axis]) -> None:
    """Ask those once more, as the interface may not have let their answers through; wait for these."""
    for axis in silent:
        bench.send_urgent(axis.node, _request(axis))
    threading.Event().wait(ANSWER_S)


def axes_of(draft: Draft) -> Iterator[Axis]:
    """Yield every drive that was found until now: the first axis of each node, and each joint's."""
    for table in draft.tables:
        kind, _, name = table.partition(".")
        if kind == "node" and name in _NODE_NAMES and draft.has(table, "identity"):
            yield Axis(int(name))
    yield from _joints_of(draft)


def _joints_of(draft: Draft) -> dict[Axis, str]:
    """Return the names of the joints that were found until now, by their axes."""
    return {
        Axis(draft.value(table, "node_id"), draft.value(table, "axis", 0)): name
        for table in draft.tables
        if table.startswith("joint.") and draft.has(table, "node_id")
        for name in [table.removeprefix("joint.")]
    }


def _joints_in(file: Path) -> dict[Axis, str] | None:
    """Return the joints of a robot's file by axis; None where there is one, and it does not say them."""
    try:
        joints = msgspec.convert(parse(file.read_bytes()), _File).joint
    except (FileNotFoundError, NotADirectoryError):
        return {}
    except (OSError, ValueError, Unreadable, msgspec.MsgspecError):
        return None
    return {Axis(one.node_id, one.axis): name for name, one in joints.items()}


def _may_exist(file: Path) -> bool:
    """Return whether it is there, or nobody can tell."""
    try:
        return file.exists()
    except OSError:
        return True


def _request(axis: Axis) -> bytes:
    return expedited(axis.index(CONTROLWORD), 0, Controlword.QUICK_STOP.data)


def _confirmed(
    bench: CanBench, axes: Iterable[Axis], sent_ns: Mapping[Axis, int]
) -> dict[Axis, DriveStopped]:
    """Turn and turn about, so that one that is dead keeps no other waiting long.

    An axis that nobody knew of when the others were asked counts from now.
    """
    now_ns = time.monotonic_ns()
    left = {
        axis: (
            Stopping(Controlword.QUICK_STOP, STOPPED_STATES, WITHIN_S, asked=False),
            SdoAxis(bench.channel(axis.node), axis.number * AXIS_OFFSET),
        )
        for axis in axes
    }
    found: dict[Axis, DriveStopped] = {}
    while left:
        for axis, (stopping, where) in list(left.items()):
            outcome = stopping.turn(where)
            if outcome is not None:
                after_ms = (time.monotonic_ns() - sent_ns.get(axis, now_ns)) / 1e6
                is_confirmed = outcome is StopOutcome.CONFIRMED
                state = None if stopping.state is None else stopping.state.words
                found[axis] = DriveStopped(outcome, state, after_ms if is_confirmed else None)
                del left[axis]
    return {axis: found[axis] for axis in sorted(found, key=_place)}


def _place(axis: Axis) -> tuple[int, int]:
    return axis.node, axis.number


def _further(bench: CanBench, found: Mapping[Axis, DriveStopped]) -> Iterator[Axis]:
    """Axes beyond the first one of nodes that answer."""
    for node in {axis.node for axis, one in found.items() if one.outcome is not StopOutcome.UNREACHABLE}:
        for number in range(1, MOST_AXES):
            axis = Axis(node, number)
            try:
                if bench.read(node, axis.index(STATUSWORD)) is None:
                    break
            except DriverError:
                break
            yield axis
