"""The undo file of a joint test: its changes to the drive, on disk before they are made.

The next test of any joint does that before anything gets power; until then `joint-test stop` says so.
"""

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, Literal

import msgspec

from drivers.errors import DriverError
from drivers.joint.homing import MODE
from drivers.joint.setpoint import OFFSETS
from gateway.commission.bench import Bench
from gateway.commission.dialogue import Say, Talk
from gateway.commission.joints import words
from gateway.joint_test.limits import NotAllowed
from gateway.joint_test.parameters import Parameters, name_of
from gateway.records import durable
from gateway.records.chain import UNDECODABLE

AS_BEFORE, PUT_BACK = "as before", "put back"


class OriginalValue(msgspec.Struct, frozen=True):
    """One number of a drive; `size` in bytes."""

    index: int
    size: Literal[1, 2, 4]
    before: int
    written: int

    @property
    def name(self) -> str:
        return name_of(self.index, 0)

    def data(self, value: int) -> bytes:
        return (value & (1 << 8 * self.size) - 1).to_bytes(self.size, "little")


class Unfinished(msgspec.Struct, frozen=True):
    """A test that is under way, or was cut off."""

    joint: str
    bus: str
    node_id: int
    began: str
    who: str
    changes: tuple[OriginalValue, ...]

    @property
    def words(self) -> str:
        """The changes that an interrupted test may have left, in words."""
        left = ", ".join(f"{one.name} {one.written} instead of {one.before}" for one in self.changes)
        return (
            f"the test of the {words(self.joint)} that {self.who} began at {self.began} was cut off, and may "
            f"have left in its drive (node {self.node_id} on {self.bus}): {left}"
        )


def changes(before: Parameters, mode: int, offset: int) -> tuple[OriginalValue, ...]:
    """Return the changes of a test in this mode of operation to an axis (`offset` above the first one's)."""
    wanted = ((MODE, 1, mode), *((index, size, 0) for index, size in OFFSETS[mode]))
    known = ((index + offset, size, before.get(name_of(index + offset, 0)), to) for index, size, to in wanted)
    return tuple(
        msgspec.convert({"index": index, "size": size, "before": was, "written": to}, OriginalValue)
        for index, size, was, to in known
        if isinstance(was, int) and was != to
    )


def keep(path: Path, left: Unfinished) -> None:
    """Keep it before the first of them is written; raises `OSError`."""
    durable.write(path, msgspec.json.encode(left))


def settled(path: Path) -> None:
    """All of it is as before, as was read; raises `OSError`."""
    durable.remove(path)


def read(path: Path) -> Unfinished | None:
    """`None` where nothing is left; raises `NotAllowed` where nobody can tell."""
    try:
        return msgspec.json.decode(path.read_bytes(), type=Unfinished)
    except FileNotFoundError:
        return None
    except (OSError, *UNDECODABLE) as error:
        raise NotAllowed(
            f"{path} cannot be read ({error}): a test was cut off, and nobody knows what it has left in its "
            f"drive. Compare 6060h and 60B0h to 60B2h with the recording, then remove {path}"
        ) from error


def put_right(
    path: Path, benches: Mapping[str, Bench], joints: Mapping[str, Any], tell: Callable[..., object]
) -> Talk[None]:
    """Put back what one that was cut off has left; every drive is off. `tell` writes into the journal.

    Raises:
        NotAllowed: that cannot be done, or the drive does not confirm it.

    """
    left = read(path)
    if left is None:
        return
    yield Say(f"Note: {left.words}.")
    by_hand = f"Put it back by hand, then remove {path}"
    known = joints.get(left.joint)
    if known is None or (known.bus, known.node_id) != (left.bus, left.node_id):
        raise NotAllowed(f"this file no longer has the {words(left.joint)} there. {by_hand}")
    try:
        outcome = dict(_put_back(benches[left.bus], left))
    except DriverError as error:
        raise NotAllowed(f"it could not be put back: {error}. Begin again; else: {by_hand}") from error
    tell("joint test taken back", joint=left.joint, began=left.began, outcome=outcome)
    settled(path)
    yield Say(", ".join(f"{name}: {what}" for name, what in outcome.items()) + ".")


def _put_back(bench: Bench, left: Unfinished) -> Iterator[tuple[str, str]]:
    """Yield the result of each restored value, in words; values that others changed since are left alone."""
    for one in left.changes:
        before, written = one.data(one.before), one.data(one.written)
        held = (bench.read(left.node_id, one.index) or b"")[: one.size]
        if held not in (before, written):
            yield one.name, f"left alone: somebody has changed it since, to {held.hex(' ') or 'nothing'}"
        elif held == before:
            yield one.name, AS_BEFORE
        else:
            bench.write(left.node_id, one.index, 0, before)
            yield one.name, PUT_BACK
