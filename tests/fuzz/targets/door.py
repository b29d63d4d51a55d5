"""What a collector is asked through its door."""

import msgspec

from server_gui.core.fleet.control_socket import _answer
from server_gui.core.recording.rows import Record

TOKENS = (
    b'{"ask":"status"',
    b'{"ask":"keep","text":"',
    b'[{\\"table\\":\\"label\\",\\"fields\\":{}}]',
    b'"}',
    b"[[[[",
)
MODULES = ("server_gui.core.fleet.control_socket",)


def _keep(text: str) -> int:
    return len(msgspec.json.decode(text, type=list[Record]))


def fuzz(data: bytes) -> None:
    answers = {"status": lambda _text: {"robots": []}, "keep": _keep}
    try:
        _answer(data.partition(b"\n")[0], answers).send(None)
    except StopIteration as done:  # nothing here is waited for
        answer = done.value
    except ValueError:  # the door hangs up
        return
    assert answer in (b"", b'{"robots":[]}\n') or answer.strip().isdigit()
