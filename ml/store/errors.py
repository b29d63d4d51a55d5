"""Errors of a store.

StoreError
├── ColumnTaken        another writer has made a column since it was looked at: look again, and append anew
├── NoSuchTable        nothing has been written to it yet, or not that version
├── StoreRefused       the keys are wrong or may not do this; retrying is no use
├── StoreUnreachable   no answer, or a server's own failure: try again later, nothing is done twice
└── UnsafeStore        it cannot keep several writers apart
"""


class StoreError(Exception):
    """The store could not do what was asked."""


class ColumnTaken(StoreError):
    """A column of the table holds another unit, or another channel, than was to be written to it."""


class NoSuchTable(StoreError):
    """The table, or that version of it, is not there."""


class StoreRefused(StoreError):
    """The store does not accept the keys, or they may not do this."""


class StoreUnreachable(StoreError, ConnectionError):
    """The store did not answer, or failed; nothing is done twice when it is tried again."""


class UnsafeStore(StoreError):
    """The store does not keep two writers from overwriting each other."""
