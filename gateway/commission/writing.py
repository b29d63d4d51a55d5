"""The robot's file, with a comment at each value that says how it was found."""

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from gateway.commission.controller import CONTROLLER
from gateway.commission.draft import Draft, DraftValue
from gateway.plain_text import one_line

HEAD = """\
# {robot}, commissioned {when} by {who}. Quantities are SI: rad, m, s, N·m.
# angle = direction · counts / (counts_per_revolution · gear_ratio) · 2π + zero_offset

"""
WIDTH = 34  # of `key = value`, before its comment
LONGEST = 120  # with it; a comment that would go beyond stands above
NEEDED = ("node_id", "configure_pdos", "zero_offset")  # the last of each step that a joint cannot be without


NOT_FINISHED = "is not in it, because it was not finished: the same command goes on there."


@dataclass(frozen=True, slots=True)
class Written:
    """Result of writing the file."""

    file: str
    text: str
    findings: tuple[tuple[str, str], ...]  # of `gwrms check`: how bad, and what
    usable: bool
    unfinished: tuple[str, ...] = ()  # joints
    not_journaled: str = ""  # why

    @property
    def words(self) -> str:
        said = "".join(f"  {severity}: {words}\n" for severity, words in self.findings)
        if not self.usable:
            return f"{self.file} is written and cannot be used yet:\n{said}"
        if self.not_journaled:
            said += f"  {self.not_journaled}\n"
        if self.unfinished:
            said += f"  {', '.join(self.unfinished)} {NOT_FINISHED}\n"
        return f"{self.file} is written.\n{said}Next: gwrms gateway {self.file}"


def text(draft: Draft, who: str, when: str) -> str:
    """Return the file as the draft has it."""
    name = str(draft.value("robot", "name"))
    return HEAD.format(robot=name, when=when, who=one_line(who)) + "\n".join(_tables(draft))


def unfinished(draft: Draft) -> tuple[str, ...]:
    """Return joints whose drive is known and not what it counts: their tables would be of no use."""
    return tuple(
        joint
        for joint in draft.value("robot", "joints", ())
        if draft.has(f"joint.{joint}", "node_id")
        and not all(draft.has(f"joint.{joint}", key) for key in NEEDED)
    )


def _tables(draft: Draft) -> Iterator[str]:
    yield from _table("robot", {"name": DraftValue(draft.value("robot", "name"))})
    yield from _table("gateway", draft.tables.get("gateway", {}))
    yield from _table("can.main", draft.tables["can.main"])
    for joint in draft.value("robot", "joints"):
        node = draft.value(f"joint.{joint}", "node_id")
        if joint in unfinished(draft):
            yield f"# {joint}, node {node}, is not here: it was not finished.\n"
        elif node is not None:
            yield from _table(f"joint.{joint}", _joint(draft, joint, node))
    for table in sorted(draft.tables):
        if table.startswith(("insole.", "imu.")):
            yield from _table(table, draft.tables[table])
    yield from _controller(draft)
    yield from _guard(draft)


def _controller(draft: Draft) -> Iterator[str]:
    """Yield the table of the controller that commands the drives, and of its stop."""
    if draft.value(CONTROLLER, "value") is not None:
        node = draft.value(CONTROLLER, "node_id")
        device = {
            "bus": DraftValue("main"),
            "node_id": DraftValue(node),
            "eds": draft.tables[f"node.{node}"]["eds"],
        }
        stop = {key: draft.tables[CONTROLLER][key] for key in ("object", "value")}
        yield from _table(CONTROLLER, device)
        yield "[[stop.controller]]"
        yield from list(_table("", {"component": DraftValue(CONTROLLER.partition(".")[2]), **stop}))[1:]


def _joint(draft: Draft, joint: str, node: int) -> Mapping[str, DraftValue]:
    found = dict(draft.tables[f"joint.{joint}"])
    heart = draft.tables.get(f"node.{node}", {}).get("heartbeat", DraftValue(None))
    return {
        "bus": DraftValue("main"),
        "node_id": found.pop("node_id"),
        "eds": draft.tables[f"node.{node}"]["eds"],
        **{key: one for key, one in found.items() if key != "axis" or one.value},
    } | ({} if heart.how == "" else {"#": DraftValue(None, f"heartbeat: {heart.value} {heart.how}")})


def _guard(draft: Draft) -> Iterator[str]:
    """Rules that warn: what else a robot is to do at its limits is for its builder to say."""
    for table in sorted(draft.tables):
        if table.startswith("guard.rule."):
            joint = table.removeprefix("guard.rule.").removesuffix("_range")
            fixed = {"watch": DraftValue("joint_limit"), "on": DraftValue([joint])}
            yield from _table(table, fixed | draft.tables[table] | {"actions": DraftValue(["alarm"])})


def _table(name: str, keys: Mapping[str, DraftValue]) -> Iterator[str]:
    yield f"[{name}]"
    for key, found in keys.items():
        yield f"# {one_line(found.how)}" if key == "#" else line(key, found)
    yield ""


def line(key: str, found: DraftValue) -> str:
    """Return a value with its comment, beside it or above."""
    value = f"{key} = {_value(found.value)}"
    if not found.how:
        return value
    comment = f"# {one_line(found.how)}"
    beside = f"{value:<{WIDTH - 1}} {comment}"
    return beside if len(value) < WIDTH and len(beside) <= LONGEST else f"{comment}\n{value}"


def _value(value: Any) -> str:
    """JSON's strings, numbers, booleans and lists are TOML's too."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
