"""Access to a store, in words: the source of its keys, never the keys."""

import os
from collections.abc import Mapping
from typing import Final

from ml.store.objects import s3_options

KEY: Final = "AWS_ACCESS_KEY_ID"


def keys_told(url: str, environment: Mapping[str, str] = os.environ) -> str:
    """Return where the keys for this store come from."""
    if url.startswith("file://"):
        return "none needed: it is a folder"
    if KEY in environment:
        return f"from the environment ({KEY})"
    if "aws_access_key_id" in s3_options():
        return f"from the profile {environment.get('AWS_PROFILE', 'default')!r} of AWS"
    return f"none here: set AWS_PROFILE, or {KEY} and AWS_SECRET_ACCESS_KEY, before the window is started"


def endpoint_told(url: str, environment: Mapping[str, str] = os.environ) -> str:
    """Return the name of the service."""
    if url.startswith("file://"):
        return "this computer"
    options = s3_options()
    return environment.get("AWS_ENDPOINT_URL") or options.get("aws_endpoint") or "Amazon S3"
