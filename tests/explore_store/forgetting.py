"""A wearer is forgotten on both computers, one after the other: nothing of theirs is anywhere any more."""

import contextlib
from collections.abc import Callable, Set
from typing import Final

from ml.store import NoSuchTable, Store, upkeep
from ml.store.erasure import Name
from ml.store.labels import person, wearer
from ml.store.tables import EVENTS, LABELS, SESSIONS
from server_gui.core.cloud import forget, mend
from server_gui.core.cloud.forget import CannotForget
from server_gui.core.recording.spool import Spool
from tests.explore_store.judging import blamed, verified
from tests.explore_store.ledger import Fate, Said
from tests.explore_store.server import Server
from tests.explore_store.there import There
from tests.explore_store.world import World

PERSONS: Final = ("P01", "P02", "P03")


def play(world: World, who: int, *_: int) -> None:
    """As the command is to be used: every collector has ended, and nothing is to be mended.

    Nothing happens where somebody has damaged something, a model has learned, or a session is somebody else's
    too.
    """
    if any(server.ever_damaged or server.rolled_back for server in world.lived) or world.classes.published:
        return
    if look not in world.looks:
        world.looks.append(look)
    world.disk.disarm()
    if world.s3 is not None:
        world.s3.disarm()
    for server in world.lived:
        with world.alive(server.name):
            server.stop()
    if world.disk.cuts:  # whoever writes next sets aside what a power cut has torn
        with contextlib.suppress(NoSuchTable):
            upkeep.compact(Store.existing(world.url))
    for server in world.lived:
        _at(world, server, PERSONS[who])
    for server in world.lived:
        _accept(world, server)


def look(world: World, store: Store) -> None:
    """Nobody finds a row, a label, an event or a session of theirs."""
    there = There(store)
    numbers = {row.number for row in world.ledger.rows() if (row.robot, row.session) in world.forgotten}
    world.check(numbers.isdisjoint(there.rows), "rows of a wearer who is forgotten are there", numbers)
    for table in (LABELS, EVENTS, SESSIONS):
        left = {(line["robot"], line["session"]) for line in there.lines(table)} & world.forgotten
        world.check(not left, "something of a wearer who is forgotten is there", table.name, left)


def _at(world: World, server: Server, name: str) -> None:
    """Where the other computer has removed what this one has no second copy of, that is accepted first."""
    try:
        _forget(world, server, name)
    except CannotForget as error:
        if "somebody else" not in str(error):
            _accept(world, server)
            _forget(world, server, name)


def _forget(world: World, server: Server, name: str) -> None:
    try:
        store = Store.existing(world.url)
    except NoSuchTable:
        return
    world.times.wall_ns = server.wall_ns
    with Spool(server.folder, reserve_bytes=1, keep_bytes=1 << 20) as spool:
        known = forget.plan(store, server.folder, name, lambda _: ())
        if known.sessions:
            forget.upload(store, spool, known, name, _expect)
            known = forget.plan(store, server.folder, name, lambda _: ())
        _are_theirs(world, set(known.sessions), name)
        if known.sessions:
            left = forget.forget(store, spool, known, name, _expect)
            world.check(not left, "something of a wearer is left", left)
            gone = {(each.location, each.version) for each in known.pins}
            world.pinned = [each for each in world.pinned if each[:2] not in gone]
            _note(world, set(known.sessions))


def _accept(world: World, server: Server) -> None:
    """What another computer has removed, and this one has no second copy of, is accepted: `mend` says how."""
    with contextlib.suppress(NoSuchTable), Spool(server.folder, reserve_bytes=1, keep_bytes=1 << 20) as spool:
        store = Store.existing(world.url)
        lacks = blamed(verified(store, server))
        things = (each for each in world.ledger.things if (each.robot, each.session) in world.forgotten)
        theirs = {each.batch for each in things if each.server == server.name}
        world.check(lacks <= theirs, "forgetting somebody has taken rows of others", lacks - theirs)
        if lacks:
            mend.accept(store, spool, _expect, forget.MADE)


def _are_theirs(world: World, sessions: Set[Name], name: str) -> None:
    """All that somebody has said are theirs, and no others."""
    said: dict[tuple[Name, str, int], Said] = {}
    for each in world.ledger.all_of(Said):
        worn_by = wearer(each.label)
        if worn_by and person(worn_by) == person(name):
            said[(each.robot, each.session), each.label, each.began_ns] = each
    sure = {session for (session, *_), each in said.items() if each.sure and not each.removed}
    world.check(sure - world.forgotten <= sessions, "a wearer's session is not known", sure - sessions)
    others = sessions - {session for session, *_ in said}
    world.check(not others, "somebody else's session is taken for a wearer's", others)


def _note(world: World, sessions: Set[Name]) -> None:
    """What is gone on purpose is missed by nobody; events of losses in their sessions are gone, too."""
    world.forgotten |= sessions
    for thing in world.ledger.things:
        if (thing.robot, thing.session) in sessions:
            thing.fate = Fate.OPEN
    for loss in world.ledger.losses:
        loss.harmed |= any((each.robot, each.session) in sessions for each in loss.things)


def _expect(_steps: int) -> "contextlib.AbstractContextManager[Callable[[int], object]]":
    return contextlib.nullcontext(lambda _: None)
