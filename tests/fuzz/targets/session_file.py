"""Simulated sessions as `gwrms sim-record` writes them."""

from ml.errors import UnusableData
from ml.training.simulated import read
from tests.fuzz.files import as_file

TOKENS = (
    b'{"session":"a","subject":1,"columns":',
    b'["time","label","left_phase","right_phase","x"]}\n',
    b"[1,",
    b'"walking",',
    b"null",
    b"0.5]\n",
    b"\n",
    b"1e999",
    b"\x1f\x8b\x08\0",
    b"true",
    b"9223372036854775808",
)
MODULES = ("ml.training.simulated",)


def fuzz(data: bytes) -> None:
    with as_file("sessions.jsonl", data) as path:
        try:
            sessions = read(path)
        except UnusableData as error:
            assert str(error).startswith(str(path))
            return
    for session in sessions:
        assert session.values.shape == (len(session.stamps_ns), len(session.channels))
        assert len(session.label) == len(session.phase) == len(session.stamps_ns)
