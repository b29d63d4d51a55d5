"""Work in a thread of its own: at its end nobody waits for what was never begun."""

import threading

from server_gui.core.threads.background import Background


def test_what_waits_is_forgotten_and_what_is_under_way_is_waited_for() -> None:
    background, began, go_on = Background("test"), threading.Event(), threading.Event()

    def work() -> int:
        began.set()
        go_on.wait()
        return 1

    first, never = background.do(work), background.do(lambda: 2)
    assert began.wait(30.0)
    assert not background.close(0.0)  # it is still under way
    go_on.set()
    assert background.close(30.0)
    assert (first.result(), never.cancelled()) == (1, True)
