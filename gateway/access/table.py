"""`access.toml`: the roles on one robot."""

from typing import Literal

from msgspec import Struct

from gateway.access.folder import AccessFolder
from gateway.tables.decoding import Decoding
from gateway.tables.reading import Unreadable, read
from gateway.wire.role import Role


class OperatorSettings(Struct, frozen=True, forbid_unknown_fields=True):
    """`[operators]`: what they may beyond their role."""

    may: tuple[Literal["reset", "enable"], ...] = ()


class AccessTable(Struct, frozen=True, forbid_unknown_fields=True):
    """`access.toml`: roles of clients by their certificates' names, of users and groups of this computer."""

    clients: dict[str, Role] = {}
    users: dict[str, Role] = {}
    groups: dict[str, Role] = {}
    operators: OperatorSettings = OperatorSettings()


def table_of(folder: AccessFolder) -> tuple[AccessTable, list[str]]:
    """Return the table, and what is wrong with it.

    That is left out and told, so no mistake locks a stop out.
    """
    if not folder.table.exists():
        return AccessTable(), []
    decoding = Decoding()
    try:
        made = decoding.struct("access.toml", read(folder.table), AccessTable)
    except Unreadable as error:
        return AccessTable(), [f"{folder.table}: {error}"]
    return made or AccessTable(), [f"{folder.table}: {one.words}" for one in decoding.findings]
