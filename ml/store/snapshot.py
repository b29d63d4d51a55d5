"""A store held still: each table as it was when it was first looked at, whoever writes meanwhile."""

from deltalake import DeltaTable

from ml.store.errors import NoSuchTable
from ml.store.store import Store


class Snapshot(Store):
    """To read, for as long as one answer takes; `Snapshot.existing` opens it."""

    def __init__(self, url: str | None = None, shards: int = 1, several_writers: bool = True) -> None:
        super().__init__(url, shards, several_writers)
        self._seen: dict[str, DeltaTable | NoSuchTable] = {}

    def table(self, location: str, version: int | None = None) -> DeltaTable:
        """Return it as `Store.table`; without `version` always the same one."""
        if version is not None:
            return super().table(location, version)
        if location not in self._seen:
            try:
                self._seen[location] = super().table(location)
            except NoSuchTable as error:
                self._seen[location] = error
        found = self._seen[location]
        if isinstance(found, NoSuchTable):
            raise found
        return found

    def has(self, location: str, writer: str, sequence: int) -> bool:
        """Return whether this transaction of the writer is in the table."""
        try:
            return (self.table(location).transaction_version(writer) or 0) >= sequence
        except NoSuchTable:
            return False
