"""An object that is written once, and then lasts."""

from pathlib import Path
from urllib.parse import unquote, urlsplit

from ml.store import durable
from ml.store.objects import Objects


def create(objects: Objects, path: str, data: bytes) -> bool:
    """Write an object that is not there yet, in a folder onto its disk; False where it is."""
    if not objects.create(path, data):
        return False
    if objects.url.startswith("file://"):
        durable.synchronise([Path(unquote(urlsplit(objects.url).path)) / path])
    return True
