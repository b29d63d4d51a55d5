"""What a gateway's clients share: the loop's time, and the log."""

import contextlib

import pytest

from gateway.connections import fair_share
from gateway.connections.fair_share import FairShare
from gateway.process.loop import Loop


def test_the_log_tells_of_an_address_that_attacks_but_not_each_time(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    with contextlib.closing(Loop()) as loop:
        shared = FairShare(loop)
    for number in range(1000):
        shared.complain("10.0.0.1", "floods")
        shared.complain(f"10.0.{number}.2", "floods")
    assert caplog.text.count("10.0.0.1 floods") == 1
    assert len(caplog.records) == fair_share.COMPLAINTS
    monkeypatch.setattr(fair_share, "COMPLAIN_S", 0.0)
    shared.complain("10.0.0.1", "floods")
    assert caplog.text.count("10.0.0.1 floods") == 2


def test_one_whose_turn_raises_keeps_nobody_else_from_theirs() -> None:
    with contextlib.closing(Loop()) as loop:
        shared, ran = FairShare(loop), list[str]()
        shared.add("a", lambda: 1 // 0)
        shared.add("b", lambda: ran.append("b"))
        while loop._patience_s() == 0.0:
            loop._turn()
    assert ran == ["b"]
