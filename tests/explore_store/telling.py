"""Whether events tell what happened, of whom, when, and nothing else."""

import itertools
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Mapping
from datetime import datetime
from typing import Any

import msgspec

from ml.store.labels import utc_ns as ns
from server_gui.core.recording.batching import EventKind
from tests.explore_store.ledger import Amended, Asked, Bad, Begun, Fate, Loss, Mark, Over, Row, Thing
from tests.explore_store.robots import LATE_NS
from tests.explore_store.server import Server
from tests.explore_store.there import Line, There, identity, spool_of
from tests.explore_store.world import World

__all__ = ("events", "is_of_a_batch", "losses", "ns", "spoilt")
ROUNDED_NS = 2_000
Notification = tuple[Any, int, int]  # link, stream, number
_OF_NOW = (Row, Mark, Begun, Over, Bad, Amended)  # what has times of its own moment


def data_of(line: Line) -> dict[str, Any]:
    found: dict[str, Any] = msgspec.json.decode(line["data"])
    return found


# --- losses


def is_of_a_batch(line: Line, server: Server) -> bool:
    """Whether an event tells that a batch of this server is lost as a whole."""
    spool, _, name = str(line["spool"]).rpartition("/")
    if line["kind"] != EventKind.LOST.value or name != "lost":
        return False
    return spool.partition("/")[0] == identity(server)


def spoilt(world: World, server: Server, there: There, blamed: Collection[int]) -> None:
    """Batches that were lost as they waited are told by an event each, and verify says so too."""
    told = Counter(line["batch"] for line in there.events(EventKind.LOST) if is_of_a_batch(line, server))
    for batch in server.spoilt:
        if before := server.told_before[batch]:
            world.check(told[batch] > before,
                        "a batch is lost under a number of which a loss was told before", batch)  # fmt: skip
        else:
            world.check(bool(told[batch]), "a batch is lost as a whole, and no event tells of it", batch)
        world.check(batch in blamed, "a batch is lost as a whole, and verify says nothing of it", batch)


def losses(world: World, server: Server, there: There) -> None:
    """What each life of a server counted as lost is told: of whom, how many, and when."""
    lives: dict[int, list[Loss]] = defaultdict(list)
    for loss in world.ledger.losses:
        if loss.server == server.name:
            lives[loss.life].append(loss)
    for life, some in lives.items():
        told = [loss for loss in some if loss.told]
        if told and not any(loss.harmed for loss in told):
            _are_told(world, told, there, is_all=life in server.ended_well and told == some)


def _are_told(world: World, told: list[Loss], there: There, *, is_all: bool) -> None:
    lines = [line for line in there.events(EventKind.LOST) if line["spool"] == told[0].writer
             and line["number"] >= 0]  # below: what damage in the spool has taken  # fmt: skip
    things = [thing for loss in told for thing in loss.things if thing.fate is Fate.COUNTED]
    bad = Counter(thing.robot for thing in things if isinstance(thing, Bad))
    counted, lost = sum(data_of(line)["rows"] for line in lines), sum(loss.rows for loss in told)
    world.check(lost - bad.total() <= counted, "more rows were lost than events tell of", lost, counted)
    world.check(not is_all or counted <= lost, "events tell of more rows than were lost", counted, lost)
    if lost == bad.total() and not counted:  # else what was bad may have found no room in the queue
        _refused(world, bad, told[0].writer, there)
    for turn_ns in {loss.told_ns for loss in told}:
        _of_robots(world, [loss for loss in told if loss.told_ns == turn_ns], lines, there)


def _of_robots(world: World, told: list[Loss], lines: list[Line], there: There) -> None:
    """Of what is nowhere an event of its robot tells, and of about when it was."""
    things = [thing for loss in told for thing in loss.things if thing.fate is Fate.COUNTED]
    gone = list(_gone(things, there))
    if all(isinstance(thing, _OF_NOW) for thing in things):
        lines = [line for line in lines if _spans(line, told)]
    for robot in {thing.robot for thing in gone}:
        mine = [data_of(line) for line in lines if line["robot"] == robot]
        rows, count = sum(data["rows"] for data in mine), sum(thing.robot == robot for thing in gone)
        world.check(
            count <= rows,
            "rows were lost, and no event of their robot and time tells of it",
            robot,
            count,
            rows,
        )


def _refused(world: World, bad: Mapping[str, int], writer: str, there: There) -> None:
    """Of each robot that has sent what nobody can keep one event tells."""
    told = Counter(line["robot"] for line in there.events(EventKind.REFUSED) if line["spool"] == writer)
    world.check(told == Counter(bad.keys()), "what was refused is not told once of each robot", told, bad)


def _gone(things: list[Thing], there: There) -> Iterator[Row | Mark]:
    """What of it is known to be nowhere."""
    marks = {line["text"] for line in there.events(EventKind.MARKER)}
    for thing in things:
        if (isinstance(thing, Row) and not thing.harmed and thing.number not in there.rows) or (
            isinstance(thing, Mark) and not thing.harmed and f"mark {thing.number}" not in marks
        ):
            yield thing


def _spans(line: Line, told: list[Loss]) -> bool:
    """Whether an event says that it was then, by some clock of that life."""
    data, walls_ns = data_of(line), told[0].walls_ns
    first_ns = min(loss.since_ns for loss in told) + min(walls_ns) - ROUNDED_NS
    last_ns = told[0].told_ns + max(walls_ns) + LATE_NS + ROUNDED_NS
    return bool(first_ns <= data.get("from", 0) <= data.get("to", 0) <= last_ns)


# --- what else happened


def events(world: World, there: There) -> None:
    """Gaps, markers, entries of journals that were not seen, and clocks that were set."""
    _marks(world, there)
    _gaps(world, there)
    _journal_gaps(world, there)
    for line in there.events(EventKind.CLOCK_STEP):
        data = data_of(line)
        if "server" not in data["whose"]:
            world.check(False, "a robot's clock was set by nobody", line["text"])
            continue
        walls_ns = [wall for server in world.lived for wall in server.walls_ns
                    if identity(server) == spool_of(line)]  # fmt: skip
        if not walls_ns:  # somebody has taken its name away
            continue
        step_ns = data["to"] - data["from"]
        steps = {later - earlier for earlier in walls_ns for later in walls_ns}
        world.check(step_ns in steps, "a clock was set by so much by nobody", step_ns, steps)


def _marks(world: World, there: There) -> None:
    """Each marker once, in its session, at its time by its robot's rows."""
    lines: dict[str, list[Line]] = defaultdict(list)
    for line in there.events(EventKind.MARKER):
        lines[line["text"]].append(line)
    before: dict[tuple[str, str, int], Row] = {}
    for thing in world.ledger.things:
        whose = (thing.server, thing.robot, thing.life)
        if isinstance(thing, Row):
            before[whose] = thing
        if not isinstance(thing, Mark):
            continue
        found = lines[f"mark {thing.number}"]
        world.check(len(found) <= 1, "a marker is there twice", found)
        world.check(bool(found) or not thing.sure, "a marker was acknowledged and is not there", thing)
        for line in found:
            said = (line["robot"], line["session"])
            world.check(said == (thing.robot, thing.session), "a marker is misnamed", said, thing)
            _is_then(world, line["utc"], thing, before.get(whose), there)


def _is_then(world: World, utc: datetime, thing: Thing, row: Row | None, there: There) -> None:
    """The time is that of the robot's row before, and so much later; without one, that of the server."""
    walls_ns = set(thing.walls_ns if row else thing.walls_ns[-1:])
    if row is not None and row.sure and row.number in there.rows:
        walls_ns = {ns(there.rows[row.number][0]["utc"]) - row.true_ns - row.late_ns}
    times = [thing.at_ns + wall_ns for wall_ns in walls_ns]
    world.check(any(abs(ns(utc) - time_ns) <= ROUNDED_NS for time_ns in times),
                "an event has another time than its robot's rows", utc, times, thing)  # fmt: skip


def _gaps(world: World, there: There) -> None:
    """What never came is told with the next notification of its stream, and a new link with its first one."""
    lines: dict[tuple[str, int, int], list[Line]] = defaultdict(list)
    for line in there.events(EventKind.GAP):
        data = data_of(line)
        lines[line["connection"], data["stream"], data["seq"]].append(line)
    firsts = [row for row in world.ledger.rows() if row.place == 0]
    newest: dict[Any, Row] = {}  # by stream of a link; by link; by life
    for row in firsts:
        stream, life = (row.link, row.stream), (row.server, row.robot, row.life)
        before, in_link, in_life = (newest.get(name) for name in (stream, row.link, life))
        newest |= {stream: row, row.link: row, life: row}
        if not (row.sure and row.batch and row.number in there.rows):
            continue
        [line] = there.rows[row.number]
        told = lines.pop((line["connection"], row.stream, row.seq), [])
        for each in told:
            said, meant = ((at["robot"], at["session"], at["utc"]) for at in (each, line))
            world.check(said == meant, "a gap is told at another place than its row", said, meant)
        if before is None or before.sure:
            missed = row.seq - (before.seq if before else -1) - 1
            found = [data["missed"] for data in map(data_of, told) if "missed" in data]
            if before or in_link is None or in_link.sure:
                world.check(
                    found == [missed] * (missed > 0), "a gap is told otherwise than it was", found, missed
                )
        if in_link is None and (in_life is None or in_life.sure):
            again = sum("missed" not in data_of(each) for each in told)
            world.check(again == (in_life is not None), "a new link is not told once", again, row)


def _journal_gaps(world: World, there: There) -> None:
    """Entries that were never seen, between two tails that were."""
    asked: dict[tuple[str, str], list[Asked]] = defaultdict(list)
    for each in world.ledger.all_of(Asked):
        asked[each.server, each.robot].append(each)
    for server in world.lived:
        lines = [line for line in there.events(EventKind.JOURNAL_GAP) if spool_of(line) == identity(server)]
        for robot in {name for whose, name in asked if whose == server.name}:
            some = asked[server.name, robot]
            if server.rolled_back or server.ever_damaged or not all(each.sure for each in some):
                continue
            missing = [max(0, each.first - before.last - 1) for before, each in itertools.pairwise(some)]
            told = [data_of(line)["missing"] for line in lines if line["robot"] == robot]
            world.check(Counter(told) == Counter(filter(None, missing)),
                        "a journal's gap is told otherwise than it was", robot, told, missing)  # fmt: skip
