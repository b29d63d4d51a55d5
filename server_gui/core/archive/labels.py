"""The labels of the session that is played: read, given and taken back without waiting for the store."""

import getpass
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any

from ml.store import StoreError
from ml.store.labels import INSTANTS, Label, LabelSource
from ml.store.sessions import Session
from server_gui.core.archive.labelling import BadLabel, Kept, Labelling, Where
from server_gui.core.settings.server_file import ServerSettings
from server_gui.core.threads.answers import Deliver, when_done

Do = Callable[[Callable[[], Any]], "Future[Any]"]  # does it in a thread


class SessionLabels:
    """For the window's thread; `do` works in another one. `revision` rises with each change."""

    def __init__(self, settings: ServerSettings, do: Do, deliver: Deliver, author: str = "") -> None:
        self.author = author or getpass.getuser()
        self.session: Session | None = None
        self.labels: tuple[Label, ...] = ()
        self.said = ""  # what came of the latest
        self.failed = False
        self.revision = 0
        self._labelling = Labelling(settings)
        self._do = do
        self._deliver = deliver

    def open(self, session: Session) -> None:
        """Those of this session, from now on."""
        self.session, self.labels = session, ()
        self._say("")
        self._read()

    def add(self, text: str, began_ns: int, ended_ns: int) -> None:
        """Add a label from `began_ns` to `ended_ns`, UTC."""
        session = self.session
        if session is None:
            return
        label = Label(
            robot=session.robot,
            session=session.session,
            began_utc_ns=began_ns,
            ended_utc_ns=began_ns if text in INSTANTS else ended_ns,
            label=text.strip(),
            author=self.author,
            source=LabelSource.PERSON,
        )
        self._ask(lambda: self._labelling.add_all([label]), f"labelled: {label.label}")

    def remove(self, label: Label) -> None:
        """Take this one back."""
        self._ask(lambda: self._labelling.remove(label), f"taken back: {label.label}")

    def _ask(self, work: Callable[[], Kept], done: str) -> None:
        self._say("…")
        when_done(self._do(work), self._deliver, lambda kept: self._kept(done, kept), self._failed)

    def _kept(self, done: str, kept: Kept) -> None:
        where = (
            "in the store"
            if kept.where is Where.STORE
            else "safe here, goes to the store with the next upload"
        )
        self._say(f"{done}, {where}" if kept.new else f"{done}: it was so already")
        self._read()

    def _read(self) -> None:
        session = self.session
        if session is not None:
            when_done(
                self._do(lambda: self._labelling.ls(session)),
                self._deliver,
                lambda labels: self._found(session, labels),
                self._failed,
            )

    def _found(self, session: Session, labels: list[Label]) -> None:
        if session is self.session:
            self.labels = tuple(labels)
            self.revision += 1

    def _failed(self, error: Exception) -> None:
        known = isinstance(error, BadLabel | StoreError)
        self._say(str(error) if known else f"{type(error).__name__}: {error}", failed=True)

    def _say(self, text: str, *, failed: bool = False) -> None:
        self.said, self.failed = text, failed
        self.revision += 1
