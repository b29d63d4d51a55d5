"""What can go wrong while recording.

RecordingError
└── SpoolUnusable   the spool's folder or one of its files cannot be used; says what to do
    └── Damaged     a file of it is no database any more, or not one of ours
"""


class RecordingError(Exception):
    """The recorder or its spool could not do what was asked."""


class SpoolUnusable(RecordingError):
    """The spool's folder or one of its files cannot be used."""


class Damaged(SpoolUnusable):
    """A file of the spool does not hold what was written to it."""
