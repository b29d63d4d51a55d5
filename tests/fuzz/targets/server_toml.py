"""The server's file, and a value changed in it."""

import tomllib

from server_gui.core.settings.file_edits import changed
from server_gui.core.settings.server_file import SettingsError, load
from tests.fuzz.files import as_file

TOKENS = (
    b"[robots]\n",
    b'exo-01 = "192.0.2.7:7420"\n',
    b"[store]\n",
    b'url = "s3://bucket/prefix"\n',
    b"[recorder]\n",
    b'upload = "idle"\n',
    b"[[rules]]\n",
    b'task = "falling"\n',
    b"at_least = 0.9\n",
    b"nan",
    b"[[",
    b"{}",
    b"true",
    b"'''",
    b"#",
)
MODULES = ("server_gui.core.settings.server_file", "server_gui.core.settings.file_edits")


def fuzz(data: bytes) -> None:
    with as_file("server.toml", data) as path:
        try:
            load(path)
        except SettingsError as error:
            assert str(error).startswith(f"{path}")
            return
        text = path.read_text(encoding="utf-8")
    tomllib.loads(text)
    changed(text, {("recorder", "upload"): "manual", ("store", "url"): "file:///x"})
