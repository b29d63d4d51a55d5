"""What may be written, and by whom: states that are named, and a lease whose time is over."""

from types import SimpleNamespace
from typing import Any

import pytest

from drivers.joint.cia402 import DriveState
from gateway.modules.control.lease import Leases
from gateway.modules.control.rules import allowed_states
from gateway.process.loop import Loop
from gateway.wire.framing import RpcError


def test_naming_a_state_lets_nobody_write_to_a_drive_with_current_what_is_not_live() -> None:
    settings: Any = SimpleNamespace(live=False, states=tuple(state.words for state in DriveState))
    parameter: Any = SimpleNamespace(settings=settings)
    allowed = allowed_states(parameter)
    assert allowed is not None
    assert DriveState.SWITCHED_ON in allowed
    assert not allowed & {
        DriveState.OPERATION_ENABLED,
        DriveState.QUICK_STOP_ACTIVE,
        DriveState.FAULT_REACTION_ACTIVE,
    }


def test_a_lease_whose_time_is_over_lets_nobody_write_although_the_loop_is_late(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    now_ns = 1_000_000_000
    monkeypatch.setattr("gateway.modules.control.lease.time.monotonic_ns", lambda: now_ns)
    loop = Loop()
    leases = Leases(loop, lambda _session, _what: None)
    session: Any = SimpleNamespace(closed=False, on_close=lambda *_what: None, who="tester")
    leases.acquire(session, 2.0)
    now_ns += 1_999_999_999
    leases.require(session)
    now_ns += 1
    with pytest.raises(RpcError, match="holds no lease"):
        leases.require(session)
    loop.close()
