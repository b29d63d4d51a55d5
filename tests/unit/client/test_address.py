"""Addresses as people type them."""

import pytest

from gateway.client import Address, BadAddress


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("exo.local", "exo.local", 7420),
        ("exo.local:7000", "exo.local", 7000),
        (":7000", "127.0.0.1", 7000),
        ("[::1]", "::1", 7420),
        ("[fe80::1]:7000", "fe80::1", 7000),
    ],
)
def test_address_is_read(text: str, host: str, port: int) -> None:
    assert Address.parse(text) == Address(host, port)


@pytest.mark.parametrize(
    "text",
    ["", "host:0", "host:65536", "host:port", "::1", "fe80::1:7000", "host:-1", "host:٣", "7520", "exo.sock"],
)
def test_wrong_address_says_what_to_write(text: str) -> None:
    with pytest.raises(BadAddress, match="write"):
        Address.parse(text)


@pytest.mark.parametrize("text", ["exo:7420", "[::1]:7420"])
def test_address_is_written_as_it_is_read(text: str) -> None:
    assert str(Address.parse(text)) == text
