"""`gwrms watch` on a bus that is opened for it: the first row has a value, or nothing has come for long."""

import pytest

from gateway.cli.watch import Row, _from_first_value


def test_watch_begins_with_the_first_value(capsys: pytest.CaptureFixture[str]) -> None:
    def rows(*values: float | None) -> list[Row]:
        return [(10**9 * at, None, {"left_knee.state": one}) for at, one in enumerate(values)]

    assert list(_from_first_value(iter(rows(None, None, 5.0, None)))) == rows(None, None, 5.0, None)[2:]
    assert capsys.readouterr().err == "gwrms watch: no value has come yet; waiting for 3 s at most\n"
    nothing = rows(*[None] * 6)
    assert list(_from_first_value(iter(nothing))) == nothing[3:]
    assert list(_from_first_value(iter(rows(1.0, None)))) == rows(1.0, None)
