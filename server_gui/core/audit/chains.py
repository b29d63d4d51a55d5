"""A journal's entries from several places put together: each once, in their order, and whether they hold."""

from collections.abc import Iterable, Sequence
from typing import Any

import msgspec

from gateway.records.chain import Broken, check

Entry = dict[str, Any]


def chained(entries: Iterable[Entry]) -> list[list[Entry]]:
    """Stretches without a hole, oldest first; what is there twice is in them once.

    A robot's clock may jump, so within a stretch the numbers count, and time only between stretches.
    """
    found: list[list[Entry]] = []
    ends: dict[object, list[Entry]] = {}
    for entry in sorted({entry["hash"]: entry for entry in entries}.values(), key=lambda entry: entry["n"]):
        stretch = ends.pop(entry.get("previous"), None)
        if stretch is None:
            stretch = []
            found.append(stretch)
        stretch.append(entry)
        ends[entry["hash"]] = stretch
    return sorted(found, key=lambda stretch: stretch[-1].get("utc_ns") or 0)


def journals(stretches: Iterable[list[Entry]]) -> list[list[Entry]]:
    """Return the same by journal: one that was begun anew on its robot counts from one again."""
    found: list[list[Entry]] = []
    for stretch in stretches:
        if found and found[-1][-1]["n"] < stretch[0]["n"]:
            found[-1].extend(stretch)
        else:
            found.append(list(stretch))
    return found


def problem(stretches: Sequence[Sequence[Entry]]) -> str | None:
    """Return where a journal was altered, in words; None where nothing shows that it was."""
    for stretch in stretches:
        previous = None
        for entry in stretch:
            try:
                head, _ = check(entry["n"], previous, msgspec.json.encode(entry))
            except (Broken, KeyError) as error:
                return str(error) if isinstance(error, Broken) else f"entry {entry['n']} has no {error}"
            previous = head.hash
    return fork(stretches)


def fork(stretches: Sequence[Sequence[Entry]]) -> str | None:
    """Return where two entries claim one place, in words.

    Two entries cannot follow the same one; only a journal that was begun anew has another first one.
    """
    seen: set[tuple[int, object]] = set()
    for stretch in stretches:
        for entry in stretch:
            place = entry["n"], entry.get("previous")
            if place in seen and entry["n"] > 1:
                return f"entry {entry['n']} is there in two versions"
            seen.add(place)
    return None
