"""Names of interfaces: every one that there is, and what is said of one that there is not."""

import can
import pytest

from drivers.bus.interfaces.opening import interfaces, is_interface
from drivers.bus.interfaces.python_can import PythonCanTransport
from drivers.bus.settings import CanSettings
from drivers.errors import Unavailable


def test_every_interface_of_python_can_is_known() -> None:
    assert set(can.VALID_INTERFACES) == set(interfaces())
    assert all(map(is_interface, interfaces()))


def test_an_interface_that_nobody_has_is_unavailable_and_no_internal_error() -> None:
    assert not is_interface("socketcann")
    with pytest.raises(Unavailable, match="socketcann"):
        PythonCanTransport(CanSettings(interface="socketcann", channel="can0"))
