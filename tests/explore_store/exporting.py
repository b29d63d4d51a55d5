"""Whether recordings as people read them, from store and spool together, are what was handed in."""

from collections import defaultdict
from collections.abc import Iterator
from typing import Any

from ml.store import StoreError, sessions
from ml.store.labels import utc_ns
from server_gui.core.cloud.recordings import Recorded, Recordings
from server_gui.core.recording.errors import RecordingError
from tests.explore_store import said
from tests.explore_store.ledger import Row, Said
from tests.explore_store.robots import ANGLE, NO_DIMENSION, RATIO
from tests.explore_store.server import Server
from tests.explore_store.there import Line, number_of, values_of
from tests.explore_store.world import World


def exports(world: World, server: Server) -> None:
    """Each session is there with each of its rows and labels; an error needs damage, or no store at all."""
    world.times.wall_ns = server.wall_ns
    faults = world.faults
    try:
        known = Recordings(world.url, server.folder)
        for session in known.sessions():
            _export(world, server, known, session)
        there = {(each.robot, each.session) for each in known.sessions()}
        lacks = [row for row in _mine(world, server) if (row.robot, row.session) not in there]
        world.check(not lacks, "an export lacks sessions", lacks)
    except RecordingError as error:
        world.check(bool(server.damaged), "an export fails without cause", error)
    except StoreError as error:
        # A torn entry is set aside by whoever writes next; who reads before that is told so.
        world.check(world.explains(str(error), faults), "an export fails without cause", error)
        is_torn = world.disk.cuts > 0
        world.check(is_torn or not list(_mine(world, server)), "an export finds no store, and there are rows")


def _mine(world: World, server: Server) -> Iterator[Row]:
    """What this server's people must find."""
    return (row for row in world.ledger.rows() if row.server == server.name and row.sure)


def _export(world: World, server: Server, known: Recordings, session: sessions.Session) -> None:
    mine = {
        row.number: row for row in world.ledger.rows()
        if (row.robot, row.session) == (session.robot, session.session)
    }  # fmt: skip
    recorded = (
        known.open(session) if mine or session.rows or session.first else Recorded(session, (), 0, (), "")
    )
    found = []
    units = {each.name: each.unit for each in recorded.channels}
    for line in _exported(recorded):
        number = number_of(line) or 0
        found.append(number)
        world.check(number in mine, "an export has rows of others", number)
        _is(world, mine[number], line, units)
    world.check(len(found) == len(set(found)), "an export has rows twice", found)
    world.check(
        recorded.session.rows == len(found), "an export is listed with other rows", recorded.session, found
    )
    wanted = {row.number for row in _mine(world, server) if row.number in mine}
    world.check(wanted <= set(found), "an export lacks rows", session.session, sorted(wanted - set(found)))
    orders: dict[Any, list[int]] = defaultdict(list)
    for number in found:
        orders[mine[number].link].append(number)
    for link, numbers in orders.items():
        world.check(numbers == sorted(numbers), "an export has rows in another order", link, numbers)
    whose = (server.name, session.robot, session.session)
    if any((each.server, each.robot, each.session) == whose for each in world.ledger.all_of(Said)):
        hold = {said.label_of(line) for line in known.labels(session)}
        said.labels(world, hold, (server.name, (session.robot, session.session)))


def _exported(recorded: Recorded) -> Iterator[Line]:
    names = [each.name for each in recorded.channels]
    for table in recorded.telemetry(names):
        yield from table.to_pylist()


def _is(world: World, row: Row, line: Line, units: dict[str, str | None]) -> None:
    """The row's time and values."""
    times = {row.utc_ns(wall_ns) for wall_ns in row.walls_ns}
    world.check(line["stamp_ns"] == row.stamp_ns and utc_ns(line["utc"]) in times,
                "an export has a row at another time", line, row)  # fmt: skip
    found = values_of(line, ANGLE)
    world.check(list(found.values()) == ([] if row.angle is None else [row.angle]),
                "an export has another value", row.number, found, row.angle)  # fmt: skip
    for name in found:
        world.check(row.unit in (units[name], None), "an export has a value in another unit",
                    row.number, name, units[name], row.unit)  # fmt: skip
    ratio = {units[name]: value for name, value in values_of(line, RATIO).items()}
    world.check(ratio == {NO_DIMENSION: row.ratio},
                "an export lacks a channel without a dimension, or has it otherwise", row, ratio)  # fmt: skip
