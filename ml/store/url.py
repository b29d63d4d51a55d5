"""A store's URL: which kinds there are, and the one that is meant where none is named."""

import os
from pathlib import Path
from urllib.parse import urlsplit

from ml.store.errors import StoreError


def default_url() -> str:
    """Return the URL below the user's own data (XDG base directories)."""
    data = os.environ.get("XDG_DATA_HOME")
    folder = (Path(data) if data else Path.home() / ".local" / "share") / "gwrms" / "store"
    return folder.as_uri()


def checked_url(url: str) -> str:
    """Return the URL without a slash at its end.

    Raises:
        StoreError: it is of another kind, or has credentials in it.

    """
    try:
        parts = urlsplit(url)
    except ValueError as error:
        raise StoreError(f"{url!r} is no URL: {error}") from error
    if parts.username or parts.password or parts.query:
        raise StoreError("a store's URL has no keys in it: give them by the AWS environment or profile")
    folder = parts.scheme == "file" and not parts.netloc and parts.path.startswith("/")
    if not (folder or (parts.scheme == "s3" and parts.netloc)):
        raise StoreError(f"{url!r} is no store: use file:///folder or s3://bucket/prefix")
    return url.rstrip("/")
