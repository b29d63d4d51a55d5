"""The robot's file, with a comment at each value that says how it was found."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from gateway.commission.draft import Draft, Found

HEAD = """\
# {robot}, commissioned {when} by {who}. Quantities are SI: rad, m, s, N·m.
# angle = direction · counts / (counts_per_revolution · gear_ratio) · 2π + zero_offset

"""
WIDTH = 34  # of `key = value`, before its comment


def text(draft: Draft, who: str, when: str) -> str:
    """The file as the draft has it."""
    name = str(draft.value("robot", "name"))
    return HEAD.format(robot=name, when=when, who=who) + "\n".join(_tables(draft))


def _tables(draft: Draft) -> Iterator[str]:
    yield from _table("robot", {"name": Found(draft.value("robot", "name"))})
    yield from _table("gateway", draft.tables.get("gateway", {}))
    yield from _table("can.main", draft.tables["can.main"])
    for joint in draft.value("robot", "joints"):
        node = draft.value(f"joint.{joint}", "node_id")
        if node is not None:
            yield from _table(f"joint.{joint}", _joint(draft, joint, node))
    for table in sorted(draft.tables):
        if table.startswith(("insole.", "imu.")):
            yield from _table(table, draft.tables[table])
    yield from _guard(draft)


def _joint(draft: Draft, joint: str, node: int) -> Mapping[str, Found]:
    found = dict(draft.tables[f"joint.{joint}"])
    heart = draft.tables.get(f"node.{node}", {}).get("heartbeat", Found(None))
    return {
        "bus": Found("main"),
        "node_id": found.pop("node_id"),
        "eds": draft.tables[f"node.{node}"]["eds"],
        **{key: one for key, one in found.items() if key != "axis" or one.value},
    } | ({} if heart.how == "" else {"#": Found(None, f"heartbeat: {heart.value} {heart.how}")})


def _guard(draft: Draft) -> Iterator[str]:
    """Rules that warn: what else a robot is to do at its limits is for its builder to say."""
    for table in sorted(draft.tables):
        if table.startswith("guard.rule."):
            joint = table.removeprefix("guard.rule.").removesuffix("_range")
            fixed = {"watch": Found("joint_limit"), "on": Found([joint])}
            yield from _table(table, fixed | draft.tables[table] | {"actions": Found(["alarm"])})


def _table(name: str, keys: Mapping[str, Found]) -> Iterator[str]:
    yield f"[{name}]"
    for key, found in keys.items():
        yield f"# {found.how}" if key == "#" else _line(key, found)
    yield ""


def _line(key: str, found: Found) -> str:
    line = f"{key} = {_value(found.value)}"
    return f"{line:<{WIDTH}}# {found.how}" if found.how else line


def _value(value: Any) -> str:
    """JSON's strings, numbers, booleans and lists are TOML's too."""
    return json.dumps(value, ensure_ascii=False)
