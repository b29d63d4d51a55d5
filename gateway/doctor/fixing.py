"""Fixing, one thing at a time: a line of the robot's file, or an object through the gateway's own writes.

What is begun, and what came of it, is written down beside the robot's journal.
"""

import json
import os
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from drivers.joint.cia402 import ENERGISED, drive_state
from drivers.joint.commands import STATUSWORD
from drivers.joint.quantities import AXIS_OFFSET
from gateway.client import CallTimeout, ClientError, LinkLost, ProtocolError, RemoteError, Robot
from gateway.config.robot import RobotConfig
from gateway.doctor.file_edit import NotMended, change
from gateway.doctor.verdicts import Edit, Finding, Fix, Together, Write
from gateway.user_name import user_name
from gateway.wire.parameter import PARAMETER_WRITE, ParameterInfo

RECORD = "doctor.jsonl"
# Causes of others, the first one first: what was judged through them may be another device's, or none's.
CAUSES = ("double_node_id", "eds_product", "sides")
UNSURE = ("bit_rate", "terminator", "second_sdo_client")  # on which nothing is written to devices


class Mender:
    """Does what is safe to do by itself: `robot` is `None` where no gateway runs.

    `here` is whether the file is the robot's own, and no copy of it.
    """

    def __init__(self, config: RobotConfig, robot: Robot | None, *, here: bool = True) -> None:
        self._config = config
        self._robot = robot
        self._here = here
        self._edited: set[str] = set()
        self._acts: Mapping[type[Fix], Callable[[Any], str]] = {
            Edit: lambda edit: self._edit((edit,)),
            Together: lambda fix: self._edit(fix.edits),
            Write: self._write,
        }

    def can(self, fix: Fix) -> bool:
        """Return whether the doctor can apply this fix; all else is for people."""
        return fix.is_safe if isinstance(fix, Write) else type(fix) in self._acts

    def objection(self, finding: Finding, fix: Fix, others: Iterable[Finding]) -> str | None:
        """Return why not to do it now; then nobody is asked about it."""
        about = _touched(fix)
        if about & self._edited:
            return "it was judged by a line that has changed since: start the gateway again, then ask again"
        if (cause := self._cause(finding, fix, about, others)) is not None:
            return f"fix that first, then run gwrms doctor again: {cause.about}: {cause.words} ({cause.rule})"
        if isinstance(fix, Write):
            return self._objection_to_writing()
        return None if self._here else "this file is a copy: change the robot's own, on its computer"

    def mend(self, finding: Finding, fix: Fix) -> str:
        """Do it; returns what was done.

        Raises:
            NotMended: it was not, or nobody knows; the message says which.

        """
        self._note(finding, fix, begun=True)
        try:
            done = self._acts[type(fix)](fix)
        except NotMended as error:
            self._note(finding, fix, refused=str(error))
            raise
        self._note(finding, fix, done=done)
        return done

    def _cause(
        self, finding: Finding, fix: Fix, about: set[str], others: Iterable[Finding]
    ) -> Finding | None:
        """Return a likelier cause: another finding about the same device or its bus."""
        causes = (*CAUSES, *UNSURE) if isinstance(fix, Write) else CAUSES
        for one in others:
            earlier = causes[: causes.index(finding.rule)] if finding.rule in causes else causes
            if one.rule in earlier and any(self._is_about(one, name) for name in about):
                return one
        return None

    def _is_about(self, finding: Finding, component: str) -> bool:
        config = self._config
        names = {component}
        if component in config.joint or component in config.device:
            names |= {*config.sharing(component), config.node_of(component)[0]}
        words = finding.about.replace("[", " ").replace("]", " ").replace(".", " ").replace('"', " ").split()
        return not names.isdisjoint(words)

    def _objection_to_writing(self) -> str | None:
        if self._robot is None:
            return "objects are written through the robot's gateway only: start it, then ask again"
        hello = self._robot.hello
        return None if hello is None else hello.refused.get(PARAMETER_WRITE.name)

    def _edit(self, edits: tuple[Edit, ...]) -> str:
        change(self._config.path, edits)
        self._edited |= {edit.name for edit in edits}
        return f"{self._config.path} changed: takes effect when the gateway restarts or wakes from rest"

    def _write(self, fix: Write) -> str:
        if self._robot is None:
            raise NotMended(f"objects are written through a gateway only: start it, then {fix.words}")
        try:
            return self._written(self._robot, fix)
        except (LinkLost, CallTimeout, ProtocolError) as error:
            raise NotMended(
                f"nobody knows whether {fix.address} was written: {error}. A gateway that starts again takes "
                "back what it had not finished; ask the doctor again"
            ) from error
        except RemoteError as error:
            raise NotMended(f"the gateway refused: {error}") from error
        except ClientError as error:
            raise NotMended(f"nothing was written: {error}") from error

    def _written(self, robot: Robot, fix: Write) -> str:
        described = robot.describe()
        parameter = next(
            (one for one in described.parameters if f"{one.component}.{one.object}" == fix.address), None
        )
        if parameter is None:
            raise NotMended(f"the gateway refuses it: {_permission(fix)}")
        if described.trials:
            raise NotMended("a trial is under way: ask again when it is over")
        self._check_drives(robot)
        self._check_held(robot, fix, fix.was, "ask the doctor again")
        written = robot.write({parameter.name: _value(fix, parameter)})
        self._check_held(robot, fix, fix.value, "look at it before the robot is used")
        return f"written and read back (write {written.write}); gwrms store {fix.component} keeps it"

    def _check_drives(self, robot: Robot) -> None:
        """None of them may move by what is changed: each says itself that it is not energised."""
        for name, table in self._config.joint.items():
            word = _held(robot, name, f"0x{STATUSWORD + AXIS_OFFSET * table.axis:04X}:0")
            state = drive_state(word) if isinstance(word, int) else None
            if state is None or state in ENERGISED:
                said = "not known" if state is None else state.words
                raise NotMended(
                    f"the state of {name} is {said}: objects are changed while no drive may move. Stop the "
                    "robot, help its wearer out of it, then ask again"
                )

    def _check_held(self, robot: Robot, fix: Write, wanted: int | None, remedy: str) -> None:
        held = _held(robot, fix.component, f"0x{fix.index:04X}:{fix.subindex}")
        if wanted is not None and held != wanted:
            raise NotMended(f"{fix.address} holds {held} by now, and not {wanted}: {remedy}")

    def _note(self, finding: Finding, fix: Fix, **came: object) -> None:
        if not self._here:
            return  # the robot's own journal has its writes
        folder = self._config.records
        row = {
            "utc_s": round(time.time(), 3),
            "who": user_name(),
            "rule": finding.rule,
            "about": finding.about,
            "evidence": list(finding.evidence),
            "fix": fix.words,
            **came,
        }
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with (folder / RECORD).open("a", encoding="utf-8") as file:
                file.write(json.dumps(row, ensure_ascii=False) + "\n")
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            done = came.get("done") or came.get("refused") or "nothing was changed"
            raise NotMended(f"it cannot be written down in {folder}: {error}; {done}") from error


def _touched(fix: Fix) -> set[str]:
    """Return names of joints, devices and sensors whose table or object it changes."""
    if isinstance(fix, Write):
        return {fix.component}
    edits = fix.edits if isinstance(fix, Together) else (fix,) if isinstance(fix, Edit) else ()
    return {edit.name for edit in edits}


def _held(robot: Robot, component: str, address: str) -> object:
    """In the device's own counts; `None` where it does not tell."""
    found = robot.read_objects(component, address).values.get(address)
    return None if found is None else found.value


def _value(fix: Write, parameter: ParameterInfo) -> float:
    """In the parameter's unit."""
    return fix.value if parameter.scale == 1 else fix.value * parameter.scale


def _permission(fix: Write) -> str:
    """Return how the robot's owner permits the write."""
    lines = " and below it ".join(fix.release)
    return f"the robot's file has the last word on what may be written; this allows it: {lines}"
