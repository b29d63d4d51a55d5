"""Progress of commissioning: every step, its completion by the draft, and the present one."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum

from gateway.commission.dialogue import At
from gateway.commission.draft import Draft

ROBOT, END = "robot", "sensors and file"  # parts that are no joint


class StepState(StrEnum):
    """State of a step."""

    DONE = "done"  # what it finds is in the draft
    NOW = "now"
    NEXT = "next"
    PASSED = "passed"  # without a finding: left out, or nothing to be found


Has = Callable[[Draft, str], bool]


def _key(key: str) -> Has:
    return lambda draft, joint: draft.has(f"joint.{joint}", key)


def _of_node(key: str) -> Has:
    return lambda draft, joint: draft.has(f"node.{draft.value(f'joint.{joint}', 'node_id')}", key)


def _rated(draft: Draft, joint: str) -> bool:
    return all(
        draft.has(table, key)
        for key, table in ((key, _either(draft, joint, key)) for key in ("rated_current", "rated_torque"))
    )


def _either(draft: Draft, joint: str, key: str) -> str:
    return f"joint.{joint}" if draft.has(f"joint.{joint}", key) else f"told.{joint}"


def _sensors(draft: Draft, _part: str) -> bool:
    return any(table.startswith(("insole.", "imu.")) for table in draft.tables)


# Name, words, whether the draft has what it finds (None: gone through is done); in the order of `steps.py`.
FIRST: Mapping[str, tuple[str, Has | None]] = {
    "name": ("its name", lambda draft, _: draft.has("robot", "name")),
    "bus": ("what is on the bus", None),
    "role": ("who leads the bus", lambda draft, _: draft.has("gateway", "role")),
    "controller": ("who commands the drives", None),
    "joints": ("its joints", lambda draft, _: draft.has("robot", "joints")),
}
JOINT: Mapping[str, tuple[str, Has | None]] = {
    "drive": ("which drive", _key("node_id")),
    "file": ("its EDS", _of_node("eds")),
    "heartbeat": ("heartbeat", _of_node("heartbeat")),
    "pdo": ("PDO", _key("configure_pdos")),
    "scale": ("what counts mean", _key("zero_offset")),
    "limits": ("limits", lambda draft, joint: draft.has(f"guard.rule.{joint}_range", "max")),
    "ratings": ("ratings", _rated),
    "homing": ("homing", lambda draft, joint: draft.has(f"told.{joint}", "homing")),
}
LAST: Mapping[str, tuple[str, Has | None]] = {
    "sensors": ("feet and trunk", _sensors),
    "file": ("the file", None),
}


@dataclass(frozen=True, slots=True)
class CommissionStep:
    """One step as a face shows it."""

    part: str
    title: str
    state: StepState


class Progress:
    """Progress of one dialogue: `at` is called for each step that begins."""

    def __init__(self, draft: Draft) -> None:
        self._draft = draft
        self._seen: list[At] = []
        self._is_at_end = False

    def at(self, where: At) -> None:
        self._seen.append(where)

    def end(self) -> None:
        """Report that the file is written."""
        self._is_at_end = True

    def steps(self) -> tuple[CommissionStep, ...]:
        """Return all that are known by now: joints are once they have names."""
        return tuple(
            CommissionStep(where.part, title, self._state(where, has)) for where, title, has in self._all()
        )

    def _all(self) -> Iterator[tuple[At, str, Has | None]]:
        joints: list[str] = self._draft.value("robot", "joints", [])
        for part, table in ((ROBOT, FIRST), *((joint, JOINT) for joint in joints), (END, LAST)):
            for name, (title, has) in table.items():
                yield At(part, name), title, has

    def _state(self, where: At, has: Has | None) -> StepState:
        if self._seen and self._seen[-1] == where and not self._is_at_end:
            return StepState.NOW
        is_past = self._is_at_end or where in self._seen or self._is_behind(where)
        if is_past if has is None else has(self._draft, where.part):
            return StepState.DONE
        return StepState.PASSED if is_past else StepState.NEXT

    def _is_behind(self, where: At) -> bool:
        """Return whether a later part was begun already."""
        if not self._seen:
            return False
        order = [at for at, _, _ in self._all()]
        now = self._seen[-1]
        return now in order and order.index(where) < order.index(now)
