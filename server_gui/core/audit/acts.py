"""The journal's entries as what people did: for each parameter old, new, read back, and what came of it."""

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from gateway.wire.method import Number

Entry = Mapping[str, Any]
OPEN: Final = "NOT KNOWN how it ended"
_LEASE: Final = re.compile(r"\b(?:the |a )?lease\b")  # as the wire and the journal call the right to write


@dataclass(frozen=True, slots=True)
class Act:
    """An act on one thing; values are SI, None if the journal has none.

    `thing` is a parameter, a component or nothing; `n` and `hash` are those of the entry that began it.
    """

    n: int
    hash: str
    utc_ns: int
    who: str
    what: str
    thing: str
    outcome: str
    old: Number | None = None
    new: Number | None = None
    read_back: Number | None = None


def acts(entries: Iterable[Entry]) -> list[Act]:
    """Everything that was done, oldest first; a write's end is told at its beginning."""
    found: dict[tuple[int, str], Act] = {}
    open_: dict[object, list[tuple[int, str]]] = {}  # write or component → what was begun there
    for entry in entries:
        what, place = str(entry.get("what")), entry.get("write", entry.get("component"))
        ending = _ENDINGS.get(what)
        if ending is None or place not in open_:
            begun = {(act.n, act.thing): act for act in _begun(entry, what)}
            found |= begun
            if what in _LASTING:
                open_[place] = list(begun)
            continue
        for key in open_[place]:
            found[key] = ending(found[key], entry)
    return list(found.values())


def _begun(entry: Entry, what: str) -> Iterable[Act]:
    after, before = _numbers(entry, "after"), _numbers(entry, "before")
    said = OPEN if what in _LASTING else _words(entry.get("result") or entry.get("reason") or "")
    base = Act(
        entry["n"],
        entry["hash"],
        int(entry.get("utc_ns") or 0),
        str(entry.get("who")),
        _LEASE.sub("control", what),
        "",
        said,
    )
    if what in ("write", "write refused"):
        trial_s = entry.get("trial_s")
        word = "write" if trial_s is None else f"trial of {trial_s:g} s"
        outcome = f"refused: {said}" if what == "write refused" else said
        for name, new in after.items():
            yield dataclasses.replace(
                base, what=word, thing=name, old=before.get(name), new=new, outcome=outcome
            )
        return
    if what in ("store refused", "restore refused"):
        what, said = what.removesuffix(" refused"), f"refused: {said}"
        base = dataclasses.replace(base, what=what, outcome=said)
    yield dataclasses.replace(base, thing=str(entry.get("component") or entry.get("drive") or ""))


def _done(act: Act, entry: Entry) -> Act:
    return dataclasses.replace(
        act, read_back=_numbers(entry, "after").get(act.thing), outcome="written and read back"
    )


def _on_trial(act: Act, entry: Entry) -> Act:
    return dataclasses.replace(_done(act, entry), outcome="on trial, read back")


def _confirmed(act: Act, _entry: Entry) -> Act:
    return dataclasses.replace(act, outcome="kept after its trial")


def _other_end(act: Act, entry: Entry) -> Act:
    """Taken back, or not; in the robot's words."""
    told = entry.get("outcome")
    own = told.get(act.thing) if isinstance(told, Mapping) else None
    why = own or entry.get("result") or entry.get("reason") or ""
    said = str(entry["what"])
    outcome = f"{said}: {_LEASE.sub('control', str(why))}" if why not in ("", said) else said
    return dataclasses.replace(act, outcome=outcome)


def _told(act: Act, entry: Entry) -> Act:
    return dataclasses.replace(act, outcome=f"{entry['what']}: {entry.get('result') or ''}")


_LASTING: Final = ("write", "store", "restore")  # an entry at its beginning and one at its end
_ENDINGS: Final[Mapping[str, Callable[[Act, Entry], Act]]] = {
    "write done": _done,
    "trial begun": _on_trial,
    "trial confirmed": _confirmed,
    "taken back": _other_end,
    "NOT TAKEN BACK yet": _other_end,
    "write taken back": _other_end,
    "claimed by the stop": _other_end,
    "trial NOT confirmed": _told,
    "ROLL-BACK FAILED": _other_end,
    "store done": _told,
    "store FAILED": _told,
    "restore done": _told,
    "restore FAILED": _told,
}


def _words(said: object) -> str:
    if isinstance(said, Mapping):
        return ", ".join(f"{name}: {one}" for name, one in said.items())
    return _LEASE.sub("control", str(said))


def _numbers(entry: Entry, key: str) -> dict[str, Number]:
    found = entry.get(key)
    known = found.items() if isinstance(found, Mapping) else ()
    return {str(name): value for name, value in known if isinstance(value, int | float)}
