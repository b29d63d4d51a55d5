"""The store's files for pyarrow, without Python in between.

The table format's own way reads through Python objects. Arrow's threads still use them when a query ends
early (a LIMIT, an error) and the interpreter is going: the process then hangs or dies at its end.
"""

import os
from typing import Final
from urllib.parse import unquote, urlsplit

import pyarrow.fs

from ml.store.objects import CONNECT_TIMEOUT_S, RETRIES, TIMEOUT_S, s3_options

# pyarrow's argument → the option's name, which in capitals is the environment's variable.
_ARGUMENTS: Final = {
    "access_key": "aws_access_key_id",
    "secret_key": "aws_secret_access_key",
    "session_token": "aws_session_token",
    "region": "aws_region",
    "endpoint_override": "aws_endpoint",
}


def filesystem(url: str) -> pyarrow.fs.FileSystem:
    """Return the file system under a store's URL, with paths from there."""
    parts = urlsplit(url)
    path = unquote(parts.path)
    if parts.scheme == "file":
        return pyarrow.fs.SubTreeFileSystem(path, pyarrow.fs.LocalFileSystem())
    return pyarrow.fs.SubTreeFileSystem(f"{parts.netloc}{path}", _s3())


def _s3() -> pyarrow.fs.FileSystem:
    options = s3_options()
    known = {ours: options.get(name) or os.environ.get(name.upper()) for ours, name in _ARGUMENTS.items()}
    known["endpoint_override"] = os.environ.get("AWS_ENDPOINT_URL") or known["endpoint_override"]
    return pyarrow.fs.S3FileSystem(
        **{ours: value for ours, value in known.items() if value},
        connect_timeout=CONNECT_TIMEOUT_S,
        request_timeout=TIMEOUT_S,
        retry_strategy=pyarrow.fs.AwsStandardS3RetryStrategy(max_attempts=RETRIES),
    )
