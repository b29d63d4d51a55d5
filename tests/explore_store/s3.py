"""As much of S3 as the store asks for, in memory, from its API reference; it may fail as real ones do.

Amazon S3 API Reference: PutObject (with `If-None-Match: *`), GetObject, HeadObject, DeleteObject,
DeleteObjects, ListObjectsV2. Any key opens it.
"""

import hashlib
import http.server
import re
import threading
import urllib.parse
from collections.abc import Callable, Mapping
from email.utils import formatdate
from enum import Enum
from typing import Any, Final, Self
from xml.etree import ElementTree
from xml.sax.saxutils import escape

BUCKET: Final = "explore"
WHEN: Final = "2026-11-22T12:00:00.000Z"


class Fault(Enum):
    """What may go wrong with a request that writes."""

    UNANSWERED = 0  # it is done, and nobody hears of it
    REFUSED = 1  # 500, and nothing is done
    LATE = 2  # it is done, and no listing shows it for some requests


class S3:
    """The service; use it as a context manager, which joins its threads."""

    def __init__(self) -> None:
        self.objects: dict[str, bytes] = {}
        self.dead = False  # whoever asks has ended: nothing of theirs arrives any more
        self.on_write: Callable[[], None] = lambda: None  # before each request that writes
        self.failed = 0  # requests, in this play
        self.lock = threading.RLock()
        self._faults: list[tuple[int, Fault]] = []
        self._writes = 0
        self._hidden: dict[str, int] = {}  # keys that listings do not show, and up to which request
        self._requests = 0
        self._server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _handler(self))
        self._server.daemon_threads = True
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.02,), name="s3")

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    @property
    def environment(self) -> dict[str, str]:
        """What a client of it needs in its environment."""
        return {
            "AWS_ACCESS_KEY_ID": "explore",
            "AWS_SECRET_ACCESS_KEY": "explore",
            "AWS_REGION": "us-east-1",
            "AWS_ENDPOINT_URL": f"http://127.0.0.1:{self._server.server_address[1]}",
        }

    def arm(self, writes: int, fault: Fault) -> None:
        """Let one of the next requests that write fail so."""
        self._faults.append((self._writes + writes, fault))

    def clear(self) -> None:
        """Be as new."""
        with self.lock:
            self.objects.clear()
            self.failed = 0
            self.disarm()

    def disarm(self) -> None:
        """Be well."""
        self._faults, self._hidden, self.dead = [], {}, False

    # --- for the requests

    def write(self, key: str | None) -> Fault | None:
        """A request that writes has come; what is to go wrong with it."""
        self.on_write()
        self._writes += 1
        due = [each for each in self._faults if each[0] <= self._writes]
        if not due:
            return None
        self._faults.remove(due[0])
        self.failed += 1
        if due[0][1] is Fault.LATE and key is not None:
            self._hidden[key] = self._requests + 4
        return due[0][1]

    def listed(self, prefix: str) -> list[str]:
        self._requests += 1
        hidden = {key for key, until in self._hidden.items() if until >= self._requests}
        found = [key for key in self.objects if key.startswith(prefix)]
        self.failed += any(key in hidden for key in found)  # whoever asks now sees what is not so
        return sorted(key for key in found if key not in hidden)


def _handler(service: S3) -> type[http.server.BaseHTTPRequestHandler]:
    class Handler(http.server.BaseHTTPRequestHandler):
        protocol_version = "HTTP/1.1"
        disable_nagle_algorithm = True

        def log_message(self, *_: Any) -> None:
            pass

        def handle_one_request(self) -> None:
            try:
                super().handle_one_request()
            except OSError:
                self.close_connection = True

        def _asked(self) -> tuple[str, dict[str, str]]:
            parts = urllib.parse.urlsplit(self.path)
            path = urllib.parse.unquote(parts.path).lstrip("/")
            query = dict(urllib.parse.parse_qsl(parts.query, keep_blank_values=True))
            return path.partition("/")[2], query

        def _answer(
            self,
            status: int,
            body: bytes = b"",
            *,
            head: bool = False,
            headers: Mapping[str, str] | None = None,
        ) -> None:
            self.send_response(status)
            for name, value in {"Content-Length": str(len(body)), **(headers or {})}.items():
                self.send_header(name, value)
            self.end_headers()
            if not head:
                self.wfile.write(body)

        def _body(self) -> bytes:
            data = self.rfile.read(int(self.headers.get("Content-Length", 0)))
            if "aws-chunked" in self.headers.get("Content-Encoding", ""):
                raise NotImplementedError("chunks with signatures")
            return data

        def _write(self, key: str | None, work: Callable[[], tuple[int, bytes]], tag: str = "") -> None:
            """Do it, or what goes wrong with it."""
            with service.lock:
                if not service.dead:
                    fault = service.write(key)
                if service.dead:
                    self.close_connection = True
                    return
                if fault is Fault.REFUSED:
                    self._answer(500, _error("InternalError"))
                    return
                status, body = work()
                if fault is Fault.UNANSWERED:
                    self.close_connection = True
                    return
            self._answer(status, body, headers={"ETag": tag} if tag else None)

        def do_PUT(self) -> None:
            key, _ = self._asked()
            data = self._body()

            def put() -> tuple[int, bytes]:
                if self.headers.get("If-None-Match") == "*" and key in service.objects:
                    return 412, _error("PreconditionFailed")
                service.objects[key] = data
                return 200, b""

            self._write(key, put, _tag(data))

        def do_DELETE(self) -> None:
            key, _ = self._asked()

            def delete() -> tuple[int, bytes]:
                service.objects.pop(key, None)
                return 204, b""

            self._write(None, delete)

        def do_POST(self) -> None:
            _, query = self._asked()
            data = self._body()
            if "delete" not in query:
                self._answer(501, _error("NotImplemented"))
                return
            keys = [
                each.text or "" for each in ElementTree.fromstring(data).iter() if each.tag.endswith("Key")
            ]

            def delete() -> tuple[int, bytes]:
                for key in keys:
                    service.objects.pop(key, None)
                done = "".join(f"<Deleted><Key>{escape(key)}</Key></Deleted>" for key in keys)
                return 200, f"<DeleteResult>{done}</DeleteResult>".encode()

            self._write(None, delete)

        def do_HEAD(self) -> None:
            self._read(head=True)

        def do_GET(self) -> None:
            key, query = self._asked()
            if key:
                self._read(head=False)
            else:
                self._answer(200, _listing(service, query), headers={"Content-Type": "application/xml"})

        def _read(self, *, head: bool) -> None:
            key, _ = self._asked()
            with service.lock:
                data = service.objects.get(key)
            if service.dead:
                self.close_connection = True
                return
            if data is None:
                self._answer(404, _error("NoSuchKey"), head=head)
                return
            headers = {"ETag": _tag(data), "Last-Modified": formatdate(1_795_000_000, usegmt=True)}
            found = re.fullmatch(r"bytes=(\d*)-(\d*)", self.headers.get("Range", ""))
            if found is None:
                self._answer(200, data, head=head, headers=headers)
                return
            first = int(found[1]) if found[1] else max(0, len(data) - int(found[2]))
            last = min(int(found[2]), len(data) - 1) if found[1] and found[2] else len(data) - 1
            headers["Content-Range"] = f"bytes {first}-{last}/{len(data)}"
            self._answer(206, data[first : last + 1], head=head, headers=headers)

    return Handler


def _listing(service: S3, query: dict[str, str]) -> bytes:
    prefix, delimiter = query.get("prefix", ""), query.get("delimiter", "")
    after = query.get("start-after", "")
    contents, common = [], dict[str, None]()
    with service.lock:
        for key in service.listed(prefix):
            rest = key[len(prefix) :]
            if key <= after:
                continue
            if delimiter and delimiter in rest:
                common[prefix + rest.partition(delimiter)[0] + delimiter] = None
                continue
            data = service.objects[key]
            contents.append(
                f"<Contents><Key>{escape(key)}</Key><LastModified>{WHEN}</LastModified>"
                f"<ETag>{escape(_tag(data))}</ETag><Size>{len(data)}</Size></Contents>"
            )
    folders = "".join(f"<CommonPrefixes><Prefix>{escape(each)}</Prefix></CommonPrefixes>" for each in common)
    return (
        '<?xml version="1.0" encoding="UTF-8"?><ListBucketResult '
        'xmlns="http://s3.amazonaws.com/doc/2006-03-01/">'
        f"<Name>{BUCKET}</Name><Prefix>{escape(prefix)}</Prefix><KeyCount>{len(contents)}</KeyCount>"
        f"<MaxKeys>1000</MaxKeys><IsTruncated>false</IsTruncated>{''.join(contents)}{folders}"
        "</ListBucketResult>"
    ).encode()


def _tag(data: bytes) -> str:
    return f'"{hashlib.md5(data, usedforsecurity=False).hexdigest()}"'


def _error(code: str) -> bytes:
    return f"<Error><Code>{code}</Code><Message>{code}</Message></Error>".encode()
