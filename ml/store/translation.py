"""Translation of the libraries' errors into ours.

A server's answer may quote keys and signatures, so it is never passed on: neither in our messages nor as
the cause of our errors.
"""

import contextlib
import re
import textwrap
from collections.abc import Iterator
from typing import Final

import obstore.exceptions
from deltalake.exceptions import CommitFailedError, DeltaError, TableNotFoundError

from ml.store.errors import NoSuchTable, StoreError, StoreRefused, StoreUnreachable

_REFUSED: Final = re.compile(
    r"401 Unauthorized|403 Forbidden|lacked the necessary privileges|"
    r"HTTP status 40[13]|AWS Error ACCESS_DENIED|Missing (AccessKeyId|SecretAccessKey)"
)
_NO_TABLE: Final = re.compile(r"[Nn]ot a Delta table|[Nn]o files in log segment|LogSegment end version")
_CODE: Final = re.compile(r"<Code>(\w+)</Code>|(\d{3} [A-Z][A-Za-z ]+)|(AWS Error \w+)|(HTTP status \d+)")
_ANSWERED: Final = re.compile(r"status code|<\w|HTTP|AWS Error")
_COLOUR: Final = re.compile(r"\x1b\[\d*m")
_REASONS: Final = (
    "Connection refused",
    "dns error",
    "timed out",
    "TimedOut",
    "connection closed",
    "connection reset",
    "No space left on device",
    "Permission denied",
    "Read-only file system",
)
_GONE: Final = re.compile(
    r"Failed to open local file '([^']+)'.*No such file|Path does not exist '([^']+)'", re.S
)
_OS_ERROR: Final = re.compile(r"([A-Z][^:()\[\]]*) \(os error \d+\)|\[Errno \d+\] ([^:\[\]]+)")
_LONGEST: Final = 300
_ADVICE: Final = {
    StoreRefused: "check AWS_PROFILE, or AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, and what they may do",
    StoreUnreachable: "check the network, AWS_ENDPOINT_URL and that the service runs",
}
_ADVICE_OF_DISKS: Final = {
    "No space left on device": "make room there",
    "Permission denied": "this account must be allowed to read there, and to write what is changed",
    "Read-only file system": "mount it for writing, or take another folder",
}
_LET_GO: Final = "bring it back from a copy, or let gwrms cloud mend take it out of its table"
_OF_A_FOLDER: Final = "check the folder and its disk"
LIBRARY_ERRORS: Final = (DeltaError, obstore.exceptions.BaseError, OSError, ValueError)


@contextlib.contextmanager
def translated(doing: str) -> Iterator[None]:
    """Turn what the libraries raise within the block into our errors; `doing` names what and where.

    A lost race (`CommitFailedError`) passes: who appends knows what to do about it.
    """
    try:
        yield
    except (StoreError, CommitFailedError):
        raise
    except LIBRARY_ERRORS as error:
        kind, reason = _kind(error), _reason(error)
        advice = _ADVICE_OF_DISKS.get(reason) or (_LET_GO if _GONE.search(str(error)) else _ADVICE.get(kind))
        if advice in _ADVICE.values() and "file://" in doing:
            advice = _OF_A_FOLDER
        raise kind("; ".join(filter(None, (f"{doing}: {reason}", advice)))) from None


def _kind(error: Exception) -> type[StoreError]:
    text = str(error)
    if _GONE.search(text):  # no use to try again
        return StoreError
    if isinstance(error, TableNotFoundError) or _NO_TABLE.search(text):
        return NoSuchTable
    if isinstance(error, PermissionError) or _REFUSED.search(text):
        return StoreRefused
    if (
        isinstance(error, OSError | obstore.exceptions.GenericError)
        or "HTTP error" in text
        or "S3 error" in text
    ):
        return StoreUnreachable
    return StoreError


def _reason(error: Exception) -> str:
    """Return the error in few words; what a server answered is reduced to its code."""
    text = str(error)
    if gone := _GONE.search(text):
        return f"{gone[1] or gone[2]} is not there"
    found = [next(filter(None, groups)) for groups in _CODE.findall(text)]
    found = found or [reason for reason in _REASONS if reason in text]
    found = found or [next(filter(None, groups)).strip() for groups in _OS_ERROR.findall(text)]
    if not found and not _ANSWERED.search(text):
        line = _COLOUR.sub("", text).strip().partition("\n")[0]
        found = [textwrap.shorten(line, _LONGEST, placeholder=" …")]
    return ", ".join(dict.fromkeys(found)) or type(error).__name__
