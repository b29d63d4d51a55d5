"""Small objects of the store beside its tables, and how S3 is reached."""

import configparser
import itertools
import os
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlsplit

import obstore
import pyarrow as pa
from obstore.exceptions import AlreadyExistsError, NotFoundError
from obstore.store import MemoryStore, ObjectStore, from_url

from ml.store import durable
from ml.store.private import private_folder
from ml.store.translation import translated

CONNECT_TIMEOUT_S: Final = 5
TIMEOUT_S: Final = 60
PIECE_BYTES: Final = 8 << 20
_CLIENT: Final = ("connect_timeout", "timeout", "allow_http")
RETRIES: Final = 3  # within one request; who calls us tries again later, with patience
_PROFILE: Final = {  # what a profile's lines are called in the libraries
    "aws_access_key_id": "aws_access_key_id",
    "aws_secret_access_key": "aws_secret_access_key",
    "aws_session_token": "aws_session_token",
    "region": "aws_region",
    "endpoint_url": "aws_endpoint",
}


@dataclass(frozen=True, slots=True)
class Object:
    """An object as a listing shows it; `tag` is the service's entity tag."""

    path: str
    size_bytes: int
    changed: datetime
    tag: str


class Objects:
    """Objects under a URL: small ones read and written at once, large ones piece by piece.

    A folder that is not there is empty, and made when something is written.
    """

    def __init__(self, url: str) -> None:
        self.url = url
        self.folder = Path(unquote(urlsplit(url).path)) if url.startswith("file://") else None
        self._opened: ObjectStore | None = None
        self._objects()

    def create(self, path: str, data: bytes) -> bool:
        """Write an object that is not there yet; False where it is. In a folder it lasts then."""
        with translated(f"{self.url}/{path} cannot be written"):
            if self.folder is not None:
                return durable.create(self.folder / path, data)
            try:
                obstore.put(self._objects(write=True), path, data, mode="create", use_multipart=False)
            except AlreadyExistsError:
                return False
            return True

    def put(self, path: str, data: pa.Buffer) -> None:
        """Write an object that is in memory; for any thread."""
        with translated(f"{self.url}/{path} cannot be written"):
            to, content = self._objects(write=True), memoryview(data).cast("B")
            obstore.put(to, path, content, chunk_size=PIECE_BYTES, max_concurrency=2)

    def read(self, path: str) -> bytes | None:
        """Return an object's content, None where it is not there."""
        with translated(f"{self.url}/{path} cannot be read"):
            try:
                return bytes(obstore.get(self._objects(), path).bytes())
            except (NotFoundError, FileNotFoundError):
                return None

    def find(self, path: str) -> Object | None:
        """Return an object's facts, without a listing, which may be late; None if there is no such object."""
        with translated(f"{self.url}/{path} cannot be read"):
            try:
                found = obstore.head(self._objects(), path)
            except (NotFoundError, FileNotFoundError):
                return None
            return Object(path, found["size"], found["last_modified"], (found["e_tag"] or "").strip('"'))

    def names(self, folder: str) -> list[str]:
        """Return every object below a folder."""
        return sorted(found.path for found in self.listing(folder))

    def listing(self, folder: str = "") -> Iterator[Object]:
        """Yield every object below a folder, in no order."""
        with translated(f"{self.url}/{folder} cannot be listed"):
            for found in itertools.chain.from_iterable(obstore.list(self._objects(), folder or None)):
                tag = (found["e_tag"] or "").strip('"')
                yield Object(found["path"], found["size"], found["last_modified"], tag)

    def pieces(self, found: Object, offset: int = 0) -> Iterator[bytes]:
        """Yield an object's content from a byte on, a request a piece, so that a slow network is in time."""
        for start in range(offset, found.size_bytes, PIECE_BYTES):
            end = min(start + PIECE_BYTES, found.size_bytes)
            with translated(f"{self.url}/{found.path} cannot be read"):
                piece = bytes(obstore.get_range(self._objects(), found.path, start=start, end=end))
            yield piece

    def write(self, path: str, pieces: Iterable[bytes]) -> str:
        """Write an object, whole or not at all, over what is there; the service's entity tag."""
        with translated(f"{self.url}/{path} cannot be written"):
            writer = obstore.open_writer(self._objects(write=True), path, buffer_size=PIECE_BYTES)
            for piece in pieces:
                writer.write(piece)
            writer.close()  # without that, after an error, nothing is there
            return (obstore.head(self._objects(), path)["e_tag"] or "").strip('"')

    def remove(self, path: str) -> None:
        """Delete an object, if it is there."""
        with translated(f"{self.url}/{path} cannot be removed"):
            try:
                obstore.delete(self._objects(), path)
            except (NotFoundError, FileNotFoundError):
                return

    def _objects(self, *, write: bool = False) -> ObjectStore:
        if self._opened is None:
            if self.folder is not None and not write and not self.folder.is_dir():
                return MemoryStore()
            with translated(f"the store {self.url} cannot be opened"):
                self._opened = _open(self.url)
        return self._opened


def s3_options() -> dict[str, str]:
    """Return how S3 is reached: what the AWS environment says, and the profile where it has no keys."""
    options = {"connect_timeout": f"{CONNECT_TIMEOUT_S}s", "timeout": f"{TIMEOUT_S}s"} | _profile()
    endpoint = os.environ.get("AWS_ENDPOINT_URL") or options.get("aws_endpoint", "")
    return options | ({"allow_http": "true"} if endpoint.startswith("http://") else {})


def _open(url: str) -> ObjectStore:
    if url.startswith("file://"):
        private_folder(Path(unquote(urlsplit(url).path)))
        return from_url(url, mkdir=True)
    options = s3_options()
    client = {name: options.pop(name) for name in _CLIENT if name in options}
    settings: dict[str, Any] = {
        "config": options,
        "client_options": client,
        "retry_config": {"max_retries": RETRIES},
    }
    opened: ObjectStore = from_url(url, **settings)
    return opened


def _profile() -> dict[str, str]:
    """Keys, region and endpoint of the AWS profile, where the environment itself has no keys."""
    if "AWS_ACCESS_KEY_ID" in os.environ:
        return {}
    name = os.environ.get("AWS_PROFILE", "default")
    found: dict[str, str] = {}
    for variable, usual, section in (
        ("AWS_CONFIG_FILE", "~/.aws/config", name if name == "default" else f"profile {name}"),
        ("AWS_SHARED_CREDENTIALS_FILE", "~/.aws/credentials", name),
    ):
        profiles = configparser.ConfigParser(interpolation=None)
        profiles.read(Path(os.environ.get(variable, usual)).expanduser())
        if profiles.has_section(section):
            found |= dict(profiles.items(section))
    return {ours: found[theirs] for theirs, ours in _PROFILE.items() if theirs in found}
