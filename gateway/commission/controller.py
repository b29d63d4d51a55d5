"""The step of a stop: who commands the drives, so that a STOP reaches the controller as well as them."""

import re
from collections.abc import Mapping

import eds
from drivers.bus.settings import address_of
from drivers.scan.identification import NodeAnswers
from drivers.scan.products import Library
from eds.datatypes import DATA_TYPES
from gateway.coding import NUMBERS
from gateway.commission.dialogue import Say, Talk, choose, word
from gateway.commission.draft import Draft
from gateway.commission.nodes import OBSERVER, file_of

CONTROLLER = "device.controller"
NONE = "none"
DRIVES_ONLY = (
    "A STOP will reach the drives only: whatever commands them keeps running (gwrms check warns of it)"
)
_OBJECT = re.compile(r"0x[0-9A-Fa-f]{4}:(0x[0-9A-Fa-f]{1,2}|[0-9]{1,3})")


def controller(draft: Draft, library: Library, told: Mapping[int, NodeAnswers]) -> Talk[None]:
    """Ask for the controller's node and stopping object; without one, a stop reaches only the drives."""
    if draft.value("gateway", "role") != OBSERVER:
        return
    if draft.has(CONTROLLER, "value"):
        if draft.value(CONTROLLER, "value") is None:  # who goes on with it may be somebody else
            yield Say(DRIVES_ONLY)
        return
    others = {node: one for node, one in told.items() if not one.axes}
    known = draft.value(CONTROLLER, "node_id")
    node = known if known in others else (yield from _which(draft, others))
    if node is None:
        return
    yield from file_of(draft, library, node, others[node])
    yield from _how(draft, node)


def _which(draft: Draft, others: Mapping[int, NodeAnswers]) -> Talk[int | None]:
    names = ", ".join(f"{node} ({one.name or 'without a name'})" for node, one in sorted(others.items()))
    choice = yield from choose(
        "Which node commands the drives, so that a STOP can tell it too? "
        f"Beside the drives here are: {names or 'no others'}. {NONE}: not a CAN node, or not connected",
        (*map(str, sorted(others)), NONE),
        None if others else NONE,  # Enter alone must not leave a controller out of every STOP
    )
    if choice == NONE:
        yield Say(DRIVES_ONLY)
        draft.put(CONTROLLER, "value", None, "nobody named one")
        return None
    draft.put(CONTROLLER, "node_id", int(choice), "named as who commands the drives")
    return int(choice)


def _how(draft: Draft, node: int) -> Talk[None]:
    description = eds.load(eds.locate(draft.value(f"node.{node}", "eds"), draft.file), node)
    if not draft.has(CONTROLLER, "object"):
        typed = yield from word(
            "Which of its objects stops it (index and sub-index, as 0x2000:0)?",
            check=lambda text: _no_object(description, text),
        )
        draft.put(CONTROLLER, "object", typed, "named as what stops it")
    typed = yield from word(
        f"Which value, written to {draft.value(CONTROLLER, 'object')}, stops it?", "0", _not_whole
    )
    draft.put(CONTROLLER, "value", int(typed, 0), "typed; try it with gwrms stop before anybody relies on it")


def _no_object(description: eds.Description, text: str) -> str | None:
    if not _OBJECT.fullmatch(text):
        return f"{text!r} is no object: index and sub-index, as 0x2000:0"
    variable = description.variable(*address_of(text))
    if variable is None:
        return f"{description.path.name} has no {text}"
    data_type = DATA_TYPES.get(variable.data_type or 0)
    if data_type is None or data_type.kind not in NUMBERS or "w" not in (variable.access_type or ""):
        return f"{text} ({variable.name}) is no number that can be written"
    return None


def _not_whole(text: str) -> str | None:
    try:
        int(text, 0)
    except ValueError:
        return f"{text!r} is no whole number"
    return None
