"""Pairing, both sides over real sockets: who proves the code is let in, once, and nobody in between."""

import contextlib
import itertools
import socket
import ssl
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import msgspec
import pytest

from gateway.access.known_clients import known_in
from gateway.access.pairing import Pairing, PairingEnded
from gateway.certificates import der_of
from gateway.client import Address, NotPaired, Unreachable, WrongRobot
from gateway.client import pairing as desk
from gateway.client.keys import keys_folder, pin_of
from gateway.connections.listeners import listen
from gateway.wire.pairing import DESK, TRIES, Offer, Reply, link, new_code, normal, proof
from gateway.wire.role import Role
from tests.support.waiting import WAIT_S
from tests.unit.gateway import keyed as keys
from tests.unit.gateway.pairing_robot import CODE, Shown


@pytest.fixture
def shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Shown]:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    made = Shown(tmp_path)
    yield made
    made.close()


@pytest.fixture
def asked(shown: Shown) -> Iterator[Callable[[str], "Future[desk.Paired]"]]:
    """A desk that types a code."""
    with ThreadPoolExecutor(4) as pool:
        yield lambda code: pool.submit(desk.pair, shown.where, code)


def test_who_proves_the_code_is_known_and_knows_the_robot(
    shown: Shown, asked: Callable[[str], "Future[desk.Paired]"]
) -> None:
    waiting = shown.wait()
    paired = asked("o123 4567 89ab cdef")  # as people type it
    shown.take(waiting)
    found = paired.result()
    assert (found.robot, found.name, found.role) == ("exo-01", "anna", "operator")
    (who,) = known_in(shown.folder).by_key.values()
    assert (who.name, who.role) == ("anna", Role.OPERATOR)
    assert desk.pin(found.robot, found.address) == "exo-01"
    assert pin_of(Address("127.0.0.1", 7420)) == keys.pin(keys.ROBOT)
    assert der_of((keys_folder() / "desk.crt").read_bytes()) == waiting.result().der


def test_five_wrong_codes_void_the_right_one(
    shown: Shown, asked: Callable[[str], "Future[desk.Paired]"]
) -> None:
    waiting = shown.wait()
    for _ in range(TRIES):
        with pytest.raises(NotPaired, match="not the code"):
            asked(new_code()).result()
    with pytest.raises(PairingEnded, match="5 wrong codes"):
        waiting.result()
    assert known_in(shown.folder).by_key == {}


def test_a_hundred_guesses_at_once_are_no_more_tries(shown: Shown) -> None:
    robot, (_, certificate) = shown.own, keys.pair("guesser")
    own, pem = keys.pin("guesser"), certificate.read_text("ascii")
    codes = [new_code() for _ in range(100)] + [CODE]
    offers = [Offer(pem, "guesser", proof(DESK, code, robot, own)) for code in codes]
    with ThreadPoolExecutor(16) as pool:
        judged = list(pool.map(lambda offer: shown.pairing._judged(offer, der_of(pem.encode())), offers[:-1]))
    assert sum("not the code" in str(one) for one in judged) == TRIES
    assert shown.pairing._judged(offers[-1], der_of(pem.encode())) is not None, "the right one is too late"


def test_a_code_is_for_one_desk_and_replayed_it_is_worth_nothing(shown: Shown) -> None:
    robot, pem = shown.own, keys.pair("anna")[1].read_text("ascii")
    offer = Offer(pem, "anna", proof(DESK, CODE, robot, keys.pin("anna")))
    assert shown.pairing._judged(offer, der_of(pem.encode())) is None
    assert "another desk has used this code" in str(shown.pairing._judged(offer, der_of(pem.encode())))
    again = Pairing(shown.folder, shown.listener, new_code(), robot)
    assert "not the code" in str(again._judged(offer, der_of(pem.encode())))


def said_to(where: Address, line: bytes) -> Reply:
    """What the robot answers to that line, over TLS."""
    with keys.raw((where.host, where.port)) as bare, keys.context(None).wrap_socket(bare) as tls:
        tls.sendall(line + b"\n")
        return msgspec.json.decode(tls.makefile("rb").readline(), type=Reply)


def test_what_was_said_once_is_refused_when_it_is_said_again(shown: Shown) -> None:
    pem = keys.pair("anna")[1].read_text("ascii")
    line = msgspec.json.encode(Offer(pem, "anna", proof(DESK, CODE, shown.own, keys.pin("anna"))))
    waiting = shown.wait()
    with ThreadPoolExecutor(1) as pool:
        first = pool.submit(said_to, shown.where, line)
        shown.take(waiting)
        assert first.result().name == "anna"
    again = Pairing(shown.folder, shown.listener, new_code(), shown.own, clock=lambda: shown.time_s)
    with ThreadPoolExecutor(1) as pool:
        second = pool.submit(again.wait)
        assert "not the code" in str(said_to(shown.where, line).problem)
        shown.time_s = 1e9
        assert isinstance(second.exception(), PairingEnded)


def test_of_two_at_once_one_is_paired(
    shown: Shown, asked: Callable[[str], "Future[desk.Paired]"], monkeypatch: pytest.MonkeyPatch
) -> None:
    names = itertools.count()
    monkeypatch.setattr(desk, "own_certificate", lambda: keys.pair(f"desk-{next(names)}")[1].read_bytes())
    keys.pair("desk-0"), keys.pair("desk-1")
    waiting = shown.wait()
    both = [asked(CODE), asked(CODE)]
    shown.take(waiting)
    shown.listener.close()
    results = [one.exception() for one in both]
    assert sorted(one is None for one in results) == [False, True]
    assert len(known_in(shown.folder).by_key) == 1


def test_nobody_in_between_passes_a_proof_on(shown: Shown) -> None:
    """It has another certificate, so that what the desk proves there is wrong at the robot."""
    pem = keys.pair("anna")[1].read_text("ascii")
    offer = Offer(pem, "anna", proof(DESK, CODE, keys.pin("between"), keys.pin("anna")))
    assert "somebody is in between" in str(shown.pairing._judged(offer, der_of(pem.encode())))


def test_who_answers_without_the_code_is_not_pinned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    key, certificate = keys.pair("between")
    context.load_cert_chain(certificate, key)

    def answer(listener: socket.socket) -> None:
        connection, _ = listener.accept()
        with context.wrap_socket(connection, server_side=True) as secured:
            secured.recv(8192)
            secured.sendall(
                msgspec.json.encode(Reply("f" * 64, "exo-01", 7420, "anna", "maintainer")) + b"\n"
            )

    with listen("127.0.0.1", 0) as listener:
        answering = threading.Thread(target=answer, args=(listener,))
        answering.start()
        with pytest.raises(WrongRobot, match="does not know the code"):
            desk.pair(Address("127.0.0.1", listener.getsockname()[1]), CODE)
        answering.join()


def test_after_five_minutes_the_code_is_void(shown: Shown) -> None:
    waiting = shown.wait()
    shown.time_s = 300.0
    with pytest.raises(PairingEnded, match="nobody came in time"):
        waiting.result()


def test_who_says_nothing_or_rubbish_is_no_try_and_in_nobody_s_way(
    shown: Shown, asked: Callable[[str], "Future[desk.Paired]"]
) -> None:
    waiting = shown.wait()
    with keys.raw(("127.0.0.1", shown.where.port)) as silent:
        for _ in range(2 * TRIES):
            with (
                keys.raw(("127.0.0.1", shown.where.port)) as bare,
                keys.context(None).wrap_socket(bare) as tls,
            ):
                tls.sendall(b"{}\n")
        paired = asked(CODE)
        silent.close()
        shown.take(waiting)
        assert paired.result().name == "anna"


@pytest.mark.parametrize("says", [b"", b"\x16\x03\x01\x02\x00\x01"])
def test_silence_by_the_dozen_keeps_no_desk_out_and_nobody_waiting(
    shown: Shown, asked: Callable[[str], "Future[desk.Paired]"], says: bytes, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of an address of its own here; none of them ends while the desk waits."""
    for side in ("access", "client"):
        monkeypatch.setattr(f"gateway.{side}.pairing.SAY_S", 10 * WAIT_S)
    waiting = shown.wait()
    with contextlib.ExitStack() as open_:
        for number in range(30):
            source = ("127.0.0.2", 0)
            slow = socket.create_connection(("127.0.0.1", shown.where.port), WAIT_S, source)
            open_.enter_context(slow).sendall(says)
            if number == 15:
                paired = asked(CODE)
        candidate = waiting.result(WAIT_S)
        shown.take(waiting)
        assert (paired.result().name, candidate.name) == ("anna", desk.own_name())


def test_where_nobody_pairs_that_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    with listen("127.0.0.1", 0) as taken:
        port = taken.getsockname()[1]
    with pytest.raises(Unreachable, match=r"no robot pairs at 127\.0\.0\.1"):
        desk.pair(Address("127.0.0.1", port), CODE)


@pytest.mark.parametrize("code", ["", "0123", "0123-4567-89AB-CDEU", "0123-4567-89AB-CDEF-0"])
def test_what_is_no_code_is_refused_before_it_is_sent(code: str) -> None:
    with pytest.raises(ValueError, match="16 letters and digits"):
        normal(code)


def test_a_desk_that_gives_up_waits_no_longer(shown: Shown) -> None:
    waiting, given_up = shown.wait(), threading.Event()
    with ThreadPoolExecutor(1) as pool:
        paired = pool.submit(desk.pair, shown.where, CODE, given_up=given_up.is_set)
        candidate = waiting.result()  # nobody confirms it
        given_up.set()
        with pytest.raises(NotPaired, match="given up here"):
            paired.result()
    candidate.answer(Reply(problem="too late"))


@pytest.mark.parametrize(
    ("typed", "where"),
    [
        (("192.0.2.7", CODE), "192.0.2.7:7421"),
        (("192.0.2.7:7420", CODE), "192.0.2.7:7421"),
        (("192.0.2.7:9", CODE), "192.0.2.7:9"),
        ((f" gwrms://192.0.2.7:7421/{CODE}\n",), "192.0.2.7:7421"),
        ((link("[fe80::1]:7421", CODE),), "[fe80::1]:7421"),
    ],
)
def test_where_and_code_are_typed_or_come_as_one_link(typed: tuple[str, ...], where: str) -> None:
    found, code = desk.typed(*typed)
    assert (str(found), code) == (where, normal(CODE))


@pytest.mark.parametrize(
    "typed",
    [
        ("192.0.2.7",),
        ("/run/gwrms.sock", CODE),
        ("gwrms://192.0.2.7:7421",),
        ("gwrms:///x",),
        ("https://x/y",),
    ],
)
def test_what_is_neither_is_refused_before_anything_is_sent(typed: tuple[str, ...]) -> None:
    with pytest.raises(ValueError, match=r"HOST:PORT|16 letters"):
        desk.typed(*typed)


def test_a_port_that_is_none_is_not_written(
    shown: Shown, asked: Callable[[str], "Future[desk.Paired]"]
) -> None:
    """It would leave the file unreadable, and with it every other robot."""
    waiting = shown.wait()
    paired = asked(CODE)
    candidate = waiting.result()
    candidate.answer(Reply(shown.pairing.proof(candidate), "exo-01", 70_000, "anna", "operator"))
    with pytest.raises(NotPaired, match="70000"):
        paired.result()
