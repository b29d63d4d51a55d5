"""What can go wrong while recording.

RecordingError
└── SpoolUnusable   the spool's folder or one of its files cannot be used; says what to do
"""


class RecordingError(Exception):
    """The recorder or its spool could not do what was asked."""


class SpoolUnusable(RecordingError):
    """The spool's folder or one of its files cannot be used."""
