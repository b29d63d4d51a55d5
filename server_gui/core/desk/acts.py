"""The journal's entries as what people did: for each parameter old, new, read back, and what came of it."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from gateway.messages import Number

Entry = Mapping[str, Any]
OPEN: Final = "NOT KNOWN how it ended"


@dataclass(frozen=True, slots=True)
class Act:
    """What somebody did to one thing; values are SI, None where the journal has none.

    `thing` is a parameter, a component or nothing; `n` is the journal's number of the entry that began it.
    """

    n: int
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
    writes: dict[Any, int] = {}  # write → its entry's number
    for entry in entries:
        what = str(entry.get("what"))
        if what == "write":
            writes[entry.get("write")] = entry["n"]
        ending = _ENDINGS.get(what)
        if ending is None:
            found |= {(act.n, act.thing): act for act in _begun(entry, what)}
            continue
        begun = writes.get(entry.get("write"))
        for key in [key for key in found if key[0] == begun]:
            found[key] = ending(found[key], entry)
    return list(found.values())


def _begun(entry: Entry, what: str) -> Iterable[Act]:
    after, before = _numbers(entry, "after"), _numbers(entry, "before")
    said = str(entry.get("result") or entry.get("reason") or "")
    base = Act(entry["n"], int(entry.get("utc_ns") or 0), str(entry.get("who")), what, "", said)
    if what in ("write", "write refused"):
        trial_s = entry.get("trial_s")
        word = "write" if trial_s is None else f"trial of {trial_s:g} s"
        outcome = f"refused: {said}" if what == "write refused" else OPEN
        for name, new in after.items():
            yield dataclasses.replace(
                base, what=word, thing=name, old=before.get(name), new=new, outcome=outcome
            )
        return
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
    said = entry.get("outcome")
    own = said.get(act.thing) if isinstance(said, Mapping) else None
    why = own or entry.get("result") or entry.get("reason") or ""
    return dataclasses.replace(act, outcome=f"{entry['what']}: {why}")


_ENDINGS: Final[Mapping[str, Callable[[Act, Entry], Act]]] = {
    "write done": _done,
    "trial begun": _on_trial,
    "trial confirmed": _confirmed,
    "taken back": _other_end,
    "NOT TAKEN BACK yet": _other_end,
    "write taken back": _other_end,
    "ROLL-BACK FAILED": _other_end,
}


def _numbers(entry: Entry, key: str) -> dict[str, Number]:
    found = entry.get(key)
    known = found.items() if isinstance(found, Mapping) else ()
    return {str(name): value for name, value in known if isinstance(value, int | float)}
