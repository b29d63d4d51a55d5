"""The defects that were proved once, each with how it is put back and by what it is found.

`parts` are the texts that put it back; `words` are the steps among which it is looked for; nothing says in
which order. A defect that no play can show names a test instead, which must fail with it put back.
"""

import re
import subprocess
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from tests.explore.mutating import Part

ROOT: Final = Path(__file__).parents[2]


@dataclass(frozen=True, slots=True)
class Defect:
    """One defect: in words, the steps among which it shows, and what a violation must say of it."""

    words: str
    steps: str = ""  # named more often, it comes more often
    saying: str = ""
    test: str = ""  # as pytest names it, below tests/unit
    parts: tuple[Part, ...] = ()


_DEFECTS: Final[dict[str, Defect]] = {
    "number-again": Defect(
        "a batch number that is used again is discarded, and marked as uploaded",
        "rows send roll-back copy stop",
        "verify|not there|cannot upload",
    ),
    "units-mixed": Defect(
        "values in different units share a column, whoever added it first",
        "rows send unit",
        "another unit",
    ),
    "empty-uploaded": Defect(
        "a batch that was emptied as it waited counts as uploaded",
        "rows cut spoil",
        "a batch is lost as a whole",
    ),
    "gone-unseen": Defect(
        "nobody sees that a batch has gone as it waited",
        "rows cut spoil",
        "a batch is lost as a whole",
    ),
    "order-by-utc": Defect(
        "an export goes by UTC: a clock that is set back changes the order of rows",
        "rows turn clock export",
        "another order|moved against",
    ),
    "offset-not-held": Defect(
        "each notification has the clock's offset of its own moment",
        "rows turn clock",
        "moved against|another order",
    ),
    "last-word-by-utc": Defect(
        "of what is said of a label the newest by the clock holds: one that was removed still does",
        "label label label clock clock clock clock clock",
        "a label holds",
    ),
    "amended-by-utc": Defect(
        "amended parameters are ignored when the clock was set back",
        "amend amend clock clock clock turn",
        "a session says not|a session is over",
    ),
    "control-dropped": Defect(
        "a full queue drops sessions, labels and events",
        "rows turn reboot reboot",
        "misnamed|not there|not listed|counted|a label holds|a session says",
    ),
    "description-dropped": Defect(
        "a full queue drops what a robot says of its units",
        "rows turn unit unit unit",
        "another unit",
    ),
    "crc-ignored": Defect(
        "checksums of a damaged spool are not looked at",
        "rows turn flip flip flip flip flip flip",
        "another value|misnamed|nobody|nobody tells|no clock",
    ),
    "sessions-once": Defect(
        "after a loss the sessions that go on are not written again",
        "rows turn turn full full reboot kill",
        "not listed|not told of|a session says",
    ),
    "emptied-pin": Defect(
        "a version whose files vacuum has removed can be pinned",
        "rows send send pin pin pin vacuum vacuum compact compact",
        "pinned",
    ),
    "not-synchronised": Defect(
        "an append in a folder is not synchronised before the spool forgets",
        "rows send power power crash",
        "",
    ),
    "looked-up-never": Defect(
        "an append does not look whether its transaction is there already",
        "rows send crash kill",
        "more than once|verify",
    ),
    "torn-log": Defect(
        "an entry of a log that a power cut has torn off keeps every upload from its table",
        "send send power power crash crash compact",
        "cannot upload",
    ),
    "bad-journal": Defect(
        "a journal's entry with a hash that is none stops recording",
        "rows turn bad-journal journal",
    ),
    "alias-wearers": Defect(
        "one wearer, spelled in two ways, is on both sides of what is held out",
        "teach teach teach train",
        "both sides",
    ),
    "promotion-race": Defect(
        "a promotion race lets a model serve over another than it was judged against",
        "teach teach train train train promote promote promote",
        "serves over another",
    ),
    "head-off-by-one": Defect(
        "the newest entry of a journal that was recorded is recorded again",
        "journal journal journal turn",
        "twice|never seen|a journal's gap",
    ),
    "session-end-lost": Defect(
        "where a session begins its robot's one before does not end",
        "rows turn reboot reboot",
        "is over",
    ),
    "unit-stale": Defect(
        "a robot's rows go on in the unit that it has given up",
        "rows rows turn unit unit",
        "another unit",
    ),
    "label-back-in-sql": Defect(
        "SQL has a label again that was removed in a later batch",
        "label label label label send send",
        "SQL has other labels",
    ),
    "retain-one-more": Defect(
        "retention removes the row at its limit, too",
        "rows send send retain retain",
        "not there|verify|lacks rows",
    ),
    "only-last-pin-kept": Defect(
        "vacuum keeps one pinned version of each table",
        "rows send send pin pin pin pin compact compact compact vacuum vacuum vacuum vacuum vacuum vacuum",
        "pinned",
    ),
    "lost-says-no-rows": Defect(
        "an event of a loss says that no rows were lost",
        "rows rows turn",
        "more rows were lost|no event",
    ),
    "lost-told-to-another": Defect(
        "a loss is told in the recording of another robot",
        "rows rows turn",
        "no event of their robot",
    ),
    "lost-told-of-first-robot": Defect(
        "of several robots' losses the first one's alone is told",
        "rows rows rows turn",
        "more rows were lost|no event",
    ),
    "gap-behind-link-untold": Defect(
        "nobody is told of notifications that waited too long behind the link",
        "rows turn turn miss miss miss miss miss miss",
        "a gap is told",
    ),
    "event-by-wall-clock": Defect(
        "an event has the wall clock's time and not that of its robot's rows",
        "rows rows clock clock mark mark turn",
        "another time than its robot",
    ),
    "streams-share-offset": Defect(
        "a stream's rows are moved by what another stream was late",
        "rows rows second second second turn",
        "a time that no clock|moved against",
    ),
    "waiting-label-without-number": Defect(
        "of what waits of a label the last word does not count",
        "label label label turn clock clock clock export export",
        "a label holds",
    ),
    "export-off-by-one": Defect(
        "what waits of a session in one row alone is not exported",
        "rows rows turn cut export export",
        "other rows|lacks rows",
    ),
    "export-angles-zero": Defect(
        "an export has no values of some channels",
        "rows rows turn send export",
        "another value",
    ),
    "exports-always-refused": Defect(
        "whoever has something in the spool can export nothing",
        "rows turn export export",
        "an export fails",
    ),
    "compaction-always-fails": Defect(
        "a compaction fails each time",
        "rows send send compact",
        "a command fails",
    ),
    "query-always-fails": Defect(
        "a query fails each time",
        "rows send send query query query",
        "a command fails|the query|no",
    ),
    "retention-forgives-all": Defect(
        "after a retention verify misses no row whatever",
        test="cloud/test_damages.py::"
        "test_what_is_younger_than_retention_is_missed_also_of_a_batch_that_is_partly_older",
    ),
    "wrong-shard": Defect(
        "what one robot has recorded is looked for among the others' rows",
        "rows rows send export",
        "lacks|other rows",
    ),
    "forget-spares-events": Defect(
        "the events of a wearer who is forgotten stay in the store",
        "teach mark send forget",
        "is forgotten is there",
    ),
    "pointers-by-size": Defect(
        "model pointers are skipped or overwritten by size alone when a store is copied",
        test="cloud/test_transfer.py::test_another_pointer_or_pin_by_the_same_name_is_refused",
    ),
    "download-replaces": Defect(
        "a download by robot replaces what its folder has of another store",
        test="cloud/test_transfer.py::test_other_contents_by_the_same_name_are_refused_and_nothing_is_copied",
    ),
}


def _with_parts() -> dict[str, Defect]:
    told = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))
    parts = {name: tuple(Part(**part) for part in some) for name, some in told.items()}
    return {name: replace(one, parts=parts.get(name, ())) for name, one in _DEFECTS.items()}


DEFECTS = _with_parts()


def judge(names: list[str], seconds: float, say: Callable[[str], None]) -> int:
    """Look for each defect, put back alone in a process of its own; 1 where one was not found."""
    missed = False
    for name in names or DEFECTS:
        found = _tested(name) if DEFECTS[name].test else _looked_for(name, seconds)
        missed |= not found
        say(f"{name}: {found or 'NOT FOUND'}")
    return int(missed)


def _looked_for(name: str, seconds: float) -> str:
    """The play that shows it; nothing where none was found."""
    defect = DEFECTS[name]
    done = _run(name, "--seconds", str(seconds), "--words", *defect.steps.split(), "--saying", defect.saying)
    found = re.search(r"--replay '(.*)'", done.stdout)
    if done.returncode not in (0, 1):
        return f"cannot be put back (status {done.returncode}): {done.stderr[-300:]}"
    return found[1] if found else ""


def _tested(name: str) -> str:
    """The test that fails with it, and without it does not."""
    test = DEFECTS[name].test
    whole, put_back = _run("", "--test", test), _run(name, "--test", test)
    return test if (whole.returncode, put_back.returncode) == (0, 1) else ""


def _run(name: str, *options: str) -> subprocess.CompletedProcess[str]:
    command = [
        sys.executable,
        "-m",
        "tests.explore_store",
        *(["--with-defect", name] if name else []),
        *options,
    ]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
