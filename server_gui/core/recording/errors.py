"""Errors of recording.

RecordingError
└── SpoolUnusable   the spool's folder or one of its files cannot be used; says what to do
    ├── Damaged     a file of it is no database any more, or not one of ours
    │   └── Contradicted   the store has something else by the same name
    └── NotKept     what was to be kept is such that no file of it takes it; in parts the rest is taken
"""


class RecordingError(Exception):
    """The recorder or its spool could not do what was asked."""


class SpoolUnusable(RecordingError):
    """The spool's folder or one of its files cannot be used."""


class Damaged(SpoolUnusable):
    """A file of the spool does not hold what was written to it."""


class Contradicted(Damaged):
    """The store has other rows than a file of the spool by the same name, or one of them twice."""


class NotKept(SpoolUnusable):
    """The data cannot be written into any file, whatever the disk does."""
