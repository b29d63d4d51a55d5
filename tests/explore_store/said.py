"""Whether what was said of sessions, labels and journals is there, and the last word holds."""

from collections import Counter, defaultdict
from collections.abc import Mapping

from ml.store import sessions
from ml.store.labels import holding, utc_ns
from ml.store.query import query
from ml.store.tables import JOURNAL, LABELS
from tests.explore_store.ledger import Amended, Begun, Entry, Fate, Over, Said, Thing
from tests.explore_store.there import Line, There, identity, spool_of
from tests.explore_store.world import World

ROUNDED_NS = 2_000
Name = tuple[str, str]  # robot, session
Label = tuple[str, str, str, int, int]


def records(world: World, there: There) -> None:
    """All of it."""
    _journals(world, there)
    lines = there.lines(LABELS)
    hold = [label_of(line) for line in holding(lines)]
    labels(world, set(hold))
    if lines:
        with query(there.store, "SELECT robot, session, label, utc, ended FROM labels") as found:
            asked = [label_of(line) for batch in found.batches for line in batch.to_pylist()]
        world.check(Counter(asked) == Counter(hold), "SQL has other labels than hold", asked, hold)
    _sessions(world, there)


def _journals(world: World, there: There) -> None:
    found = Counter((spool_of(line), line["robot"], line["n"], line["hash"]) for line in there.lines(JOURNAL))
    for server in world.lived:
        some = {key: count for key, count in found.items() if key[0] == identity(server)}
        world.check(server.rolled_back or max(some.values(), default=1) == 1,
                    "an entry of a journal is there twice", some)  # fmt: skip
        harmed = {(each.robot, each.n) for each in world.ledger.all_of(Entry)
                  if each.server == server.name and each.harmed}  # fmt: skip
        what = "an entry of a journal was acknowledged and is not there"
        if server.ever_damaged:
            what = "an entry of a journal is not there, after damage in a file that it is not in"
        for each in world.ledger.all_of(Entry):
            if each.server == server.name and each.sure and (each.robot, each.n) not in harmed:
                key = (identity(server), each.robot, each.n, each.hash)
                world.check(bool(found[key]), what, each)


# --- labels


def label_of(line: Line) -> Label:
    return line["robot"], line["session"], line["label"], utc_ns(line["utc"]), utc_ns(line["ended"])


def labels(world: World, hold: set[Label], of: tuple[str, Name] | None = None) -> None:
    """The last that was said of a label holds; of all sessions, or of one of a server's, as it sees it."""
    said: dict[Label, list[Said]] = defaultdict(list)
    for thing in world.ledger.all_of(Said):
        if of in (None, (thing.server, (thing.robot, thing.session))):
            said[thing.robot, thing.session, thing.label, thing.began_ns, thing.ended_ns].append(thing)
    world.check(hold <= said.keys(), "labels hold that nobody has given", hold - said.keys())
    for key, things in said.items():
        newest = things[-1]
        what = "a label holds that was removed, or does not"
        if world.servers[newest.server].rolled_back and len(things) > 1:
            what = "what was said of a label before a roll-back holds against what was said after it"
        if newest.sure:
            world.check((key in hold) != newest.removed, what, newest)


# --- sessions


def _sessions(world: World, there: There) -> None:
    """Each session is listed, as long as it was, with what was said of it last."""
    listed = {(each.robot, each.session): each for each in sessions.sessions(there.store)}
    rows = Counter((line["robot"], line["session"]) for lines in there.rows.values() for line in lines)
    for name, each in listed.items():
        world.check(
            each.rows == rows[name], "a session is listed with other rows", name, each.rows, rows[name]
        )
    lost = rows.keys() - listed.keys()
    world.check(not lost, "a session with rows is not listed", lost)
    over = {(each.robot, each.session): each for each in world.ledger.all_of(Over)}
    kept = _written_again(world, over)
    for begun in world.ledger.all_of(Begun):
        name = (begun.robot, begun.session)
        if begun.sure or begun in kept:
            world.check(name in listed and listed[name].notes != sessions.UNTOLD,
                        "a session is not listed, or not told of", begun)  # fmt: skip
            _ended(world, listed[name], begun, over.get(name), there)
    newest = {(thing.robot, thing.session): thing for thing in world.ledger.all_of(Amended)}
    for name, thing in newest.items():
        if thing.sure or thing in kept:
            world.check(name in listed, "a session that was acknowledged is not listed", thing)
            found = listed[name].parameters
            world.check(
                found == {"value": thing.value}, "a session says not what was said last", thing, found
            )


def _written_again(world: World, over: Mapping[Name, Over]) -> set[Thing]:
    """What was said of sessions and lost, and is said again with the event of the loss, as they went on."""
    return {
        thing
        for loss in world.ledger.losses if loss.told and not loss.harmed
        for thing in loss.things
        if isinstance(thing, Begun | Amended) and thing.fate is Fate.COUNTED
        and ((thing.robot, thing.session) not in over
             or over[thing.robot, thing.session].at_ns > loss.told_ns)
    }  # fmt: skip


def _ended(world: World, listed: sessions.Session, begun: Begun, over: Over | None, there: There) -> None:
    """It says when it was over, by some clock of its life; where its server was killed, nothing."""
    if over is None:
        world.check(listed.ended is None, "a session is over that went on", begun)
    elif over.sure:
        world.check(listed.ended is not None, "a session is over, and does not say so", over)
        if listed.ended is not None and listed.ended != listed.began:
            ended_ns = utc_ns(listed.ended)
            times = [(over.at_ns + wall_ns - ROUNDED_NS, over.kept_ns + wall_ns + ROUNDED_NS)
                     for wall_ns in over.walls_ns]  # fmt: skip
            world.check(any(first <= ended_ns <= last for first, last in times),
                        "a session was over at another time", listed.ended, times, over)  # fmt: skip
