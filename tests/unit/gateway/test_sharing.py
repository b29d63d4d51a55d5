"""What a gateway's clients share: here the log."""

import contextlib

import pytest

from gateway import sharing
from gateway.loop import Loop
from gateway.sharing import Sharing


def test_the_log_tells_of_an_address_that_attacks_but_not_each_time(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(Loop()) as loop:
        shared = Sharing(loop)
    for number in range(1000):
        shared.complain("10.0.0.1", "floods")
        shared.complain(f"10.0.{number}.2", "floods")
    assert caplog.text.count("10.0.0.1 floods") == 1
    assert len(caplog.records) == sharing.COMPLAINTS
    monkeypatch.setattr(sharing, "COMPLAIN_S", 0.0)
    shared.complain("10.0.0.1", "floods")
    assert caplog.text.count("10.0.0.1 floods") == 2
