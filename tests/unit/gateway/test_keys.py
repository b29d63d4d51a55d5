"""A robot with keys: who is let in, as whom, and that nobody else is told anything."""

import os
import shutil
import socket
import ssl
import stat
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import msgspec
import pytest

from gateway.access.folder import AccessFolder
from gateway.access.identity import ANYBODY, Identity, Peer
from gateway.access.known_clients import known_in
from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.connections import handshakes
from gateway.connections.listeners import listen
from gateway.connections.tls import RECORD, TlsStream, context_of
from gateway.daemon import Daemon
from gateway.key_making import make
from gateway.records.witness import objection
from gateway.wire.control import SignedHead
from gateway.wire.limits import HANDSHAKES, HANDSHAKES_WAITING
from gateway.wire.role import Role
from tests.support.waiting import WAIT_S, until
from tests.unit.gateway import keyed as keys
from tests.unit.gateway import processes
from tests.unit.gateway.harness import CLOCK, ROBOT, STOP, Bench, Client, config, serving
from tests.unit.gateway.keyed import KeyedClient, keyed, raw, said

Connect = Callable[["str | tuple[Path, Path] | None"], KeyedClient]


@pytest.fixture
def address(bench: Bench, tmp_path: Path) -> Iterator[tuple[str, int]]:
    keyed(tmp_path)
    with serving(config(tmp_path)) as address:
        yield address


@pytest.fixture
def come(address: tuple[str, int]) -> Iterator[Connect]:
    with ExitStack() as clients:
        yield lambda whose: clients.enter_context(KeyedClient(address, whose))


def let_in(come: Connect, whose: "str | tuple[Path, Path] | None") -> bool:
    try:
        return bool(come(whose).call("hello", client="test"))
    except OSError:
        return False


# Who is let in


@pytest.mark.parametrize("name", ["viewer", "operator", "maintainer"])
def test_who_has_a_key_is_who_it_belongs_to_whatever_they_say(come: Connect, name: str) -> None:
    client = come(name)
    hello = client.call("hello", client="maintainer")
    assert (hello["identity"], hello["role"]) == (name, name)
    assert client.call("robot.stop", reason="enough")["held"] is True
    who = client.call("journal.tail", n=1)["entries"][0]["who"]
    known = fingerprint(der_of(keys.pair(name)[1].read_bytes()))
    assert who.startswith(f"{name} [{known[:16]}], maintainer (127.0.0.1:")


def test_a_name_that_a_client_gives_itself_spells_no_identity() -> None:
    forged = "anna [57a5adb29709f45f], gwrms set"
    assert ANYBODY.called("127.0.0.1:5", forged) == "anna (57a5adb29709f45f], gwrms set (127.0.0.1:5)"
    anna = Identity(Role.VIEWER, "anna", "57a5adb29709f45f" * 4)
    assert anna.called("[::1]:5", "ben [1]") == "anna [57a5adb29709f45f], ben (1] ([::1]:5)"
    assert anna.called("[::1]:5") == "anna [57a5adb29709f45f] ([::1]:5)"
    assert Identity(Role.VIEWER, "lab", peer=Peer(1000, 100)).called("@") == "lab [uid 1000] (@)"


def test_the_journals_head_is_signed_by_the_key_that_was_paired(come: Connect) -> None:
    client = come("viewer")
    client.call("robot.stop", reason="enough")
    entry = client.call("journal.tail", n=1)["entries"][0]
    head = msgspec.convert(client.call("journal.head")["head"], SignedHead)
    assert head.n >= entry["n"]
    assert objection(head, fingerprint(der_of(keys.pair(keys.ROBOT)[1].read_bytes()))) is None
    assert "another robot" in str(objection(head, "0" * 64))


def test_who_is_unknown_or_has_no_key_is_not_let_in(come: Connect) -> None:
    assert not let_in(come, "stranger")
    assert not let_in(come, None)
    assert let_in(come, "viewer")


def test_no_older_tls_is_spoken(address: tuple[str, int]) -> None:
    context = keys.context(keys.pair("operator"))
    context.maximum_version = ssl.TLSVersion.TLSv1_2
    with raw(address) as bare, pytest.raises(ssl.SSLError, match=r"(?i)version"):
        context.wrap_socket(bare)


@pytest.mark.parametrize(
    "line", [STOP % b"now", b"\x17\x03\x03\x00\x05hello", b"GET / HTTP/1.1\r\n\r\n", b"SSH-2.0-x\r\n", b"\0"]
)
def test_to_what_is_no_tls_not_a_byte_is_said_and_nothing_in_it_is_done(
    address: tuple[str, int], come: Connect, line: bytes
) -> None:
    with raw(address) as bare:
        bare.sendall(line)
        assert said(bare) == b""
    assert come("viewer").call("robot.describe")["stop"]["held"] is False


@pytest.mark.parametrize(
    ("begins", "ends"), [("20490101000000Z", "20591231235959Z"), ("19700101000000Z", "19800101000000Z")]
)
def test_no_clock_locks_anybody_out(
    come: Connect, tmp_path: Path, begins: str, ends: str, caplog: pytest.LogCaptureFixture
) -> None:
    made = keys.dated(f"of-{begins[:4]}", begins, ends)
    shutil.copy(made[1], tmp_path / "clients")
    assert come(made).call("robot.stop", reason="now")["held"] is True
    warned = [one for one in caplog.messages if "only for the time until" in one]
    assert bool(warned) == ends.startswith("1980"), "and one that has expired is told"


def test_a_key_that_is_known_vouches_for_no_other(come: Connect, tmp_path: Path) -> None:
    authority = keys.dated("authority", "20200101000000Z", "20591231235959Z", "CA:TRUE")
    shutil.copy(authority[1], tmp_path / "clients")
    assert let_in(come, authority)
    assert not let_in(come, keys.vouched_for("vouched", authority))


def test_two_desks_that_call_themselves_the_same_are_both_let_in(come: Connect, tmp_path: Path) -> None:
    """As two computers with one user and one host name do; nobody keeps another one out by their name."""
    twins = [(tmp_path / one / "desk.key", tmp_path / one / "desk.crt") for one in ("first", "second")]
    for name, twin in zip(("anna", "ben"), twins, strict=True):
        make("pi-raspberrypi", *twin)
        shutil.copy(twin[1], tmp_path / "clients" / f"{name}.crt")
    assert [let_in(come, one) for one in twins] == [True, True]


def test_a_certificate_that_cannot_be_told_in_words_keeps_nobody_out(come: Connect, tmp_path: Path) -> None:
    odd = keys.dated(
        "odd", "20200101000000Z", "20591231235959Z", "CA:FALSE\nsubjectAltName = DER:30:04:82:02:ff:fe"
    )
    shutil.copy(odd[1], tmp_path / "clients")
    assert [let_in(come, odd) for _ in range(HANDSHAKES + 1)] == [True] * (HANDSHAKES + 1)
    assert let_in(come, "operator")


def test_a_file_that_is_no_certificate_locks_nobody_else_out(come: Connect, tmp_path: Path) -> None:
    (tmp_path / "clients" / "a-torn.crt").write_text(
        "-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"
    )
    (tmp_path / "clients" / "a-text.crt").write_text("nothing")
    assert let_in(come, "operator")


def test_a_table_that_cannot_be_read_leaves_everybody_the_stop(come: Connect, tmp_path: Path) -> None:
    (tmp_path / "access.toml").write_text("[clients\n", encoding="utf-8")
    client = come("maintainer")
    assert client.call("hello", client="test")["role"] == "viewer"
    assert client.call("robot.stop", reason="now")["held"] is True


# Revoking


def test_who_is_revoked_while_connected_is_closed_and_their_trial_taken_back(
    come: Connect, bench: Bench, tmp_path: Path
) -> None:
    operator, viewer = come("operator"), come("viewer")
    operator.call("control.acquire", ttl_s=60)
    operator.call("parameter.write", changes={"gait.step_length": 0.42}, trial_s=60)
    assert bench.gait.node.objects[0x2001, 0] == (420).to_bytes(2, "little")
    (tmp_path / "clients" / "operator.crt").unlink()
    until(lambda: bench.gait.node.objects[0x2001, 0] == (400).to_bytes(2, "little"), "it is taken back")
    until(lambda: operator.line() is None, "it is closed")
    assert not let_in(come, "operator")
    assert viewer.call("clock.read")


def test_another_role_ends_what_was_open_and_counts_for_what_comes(come: Connect, tmp_path: Path) -> None:
    operator = come("operator")
    assert operator.call("control.acquire", ttl_s=60)
    (tmp_path / "access.toml").write_text('[clients]\noperator = "viewer"\n', encoding="utf-8")
    until(lambda: operator.line() is None, "it is closed")
    assert come("operator").refused("control.acquire", ttl_s=60).kind == "not_allowed"


def test_who_has_just_been_let_in_is_known_also_beside_others(come: Connect, tmp_path: Path) -> None:
    """The look at those who are there is older than who comes new."""
    assert let_in(come, "viewer")
    for name in ("first", "second", "third"):
        shutil.copy(keys.pair(name)[1], tmp_path / "clients")
        assert come(name).call("hello", client="new")["identity"] == name


# Handshakes that do not end, and too many


def test_half_a_handshake_is_closed_and_keeps_nobody_out(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(handshakes, "HANDSHAKE_S", 0.5)
    keyed(tmp_path)
    with serving(config(tmp_path)) as address, ExitStack() as open_:
        halves = [open_.enter_context(raw(address)) for _ in range(2 * HANDSHAKES)]
        for half in halves[::2]:  # the others have not even begun
            half.sendall(b"\x16\x03\x01\x02\x00\x01")
        with KeyedClient(address, "operator") as client:
            assert client.call("robot.stop", reason="now")["held"] is True
        assert [said(half) for half in halves] == [b""] * len(halves)


def test_who_says_nothing_by_hundreds_of_addresses_keeps_nobody_out(address: tuple[str, int]) -> None:
    """Which one computer has by IPv6. Here they are those of the loopback."""
    with ExitStack() as open_:
        for number in range(2 * HANDSHAKES_WAITING):
            source = (f"127.1.{number // 250}.{number % 250 + 1}", 0)
            open_.enter_context(socket.create_connection(address, timeout=WAIT_S, source_address=source))
        with KeyedClient(address, "operator") as client:
            assert client.call("robot.stop", reason="now")["held"] is True


def test_strangers_by_the_hundred_keep_nobody_s_stop_out(come: Connect, address: tuple[str, int]) -> None:
    operator, over = come("operator"), threading.Event()

    def knock() -> None:
        while not over.is_set():
            with raw(address) as bare:
                try:
                    with keys.context(keys.pair("stranger")).wrap_socket(bare) as secured:
                        secured.recv(1)
                except OSError:
                    continue

    knocking = [threading.Thread(target=knock) for _ in range(4)]
    for one in knocking:
        one.start()
    try:
        for _ in range(10):
            assert operator.call("robot.stop", reason="now")["held"] is True
        assert let_in(come, "viewer")
    finally:
        over.set()
        for one in knocking:
            one.join()


def test_a_stop_on_an_open_link_does_not_wait_for_handshakes(
    come: Connect, address: tuple[str, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Their thread hangs in one, as under any load of strangers; 200 more wait, and beyond those none."""
    operator, hangs, go_on = come("operator"), threading.Event(), threading.Event()
    assert operator.call("clock.read")

    def hang(_stream: object) -> None:
        hangs.set()
        assert go_on.wait(WAIT_S)
        raise ConnectionResetError

    monkeypatch.setattr(TlsStream, "handshake", hang)
    with ExitStack() as open_:
        open_.callback(go_on.set)
        for _ in range(200):
            open_.enter_context(raw(address)).sendall(b"\x16\x03\x01\x02\x00\x01")
        assert hangs.wait(WAIT_S)
        assert operator.call("robot.stop", reason="now")["held"] is True
        assert not go_on.is_set()


# What TLS does to lines


def test_what_is_decrypted_and_not_yet_read_is_not_forgotten(come: Connect) -> None:
    """All in one record, of which no poll tells what is left; who has just come is read in small pieces."""
    client, line = come("operator"), CLOCK % 1
    lines = line * ((RECORD - len(STOP % b"last")) // len(line))
    client.send(lines + STOP % b"last")
    assert client.answer("stop")["held"] is True
    assert client.call("clock.read")


def test_a_stop_that_comes_with_the_end_of_the_handshake_acts(address: tuple[str, int]) -> None:
    """No poll tells of it: it has been read with the handshake."""
    come, goes = ssl.MemoryBIO(), ssl.MemoryBIO()
    secured = keys.context(keys.pair("viewer")).wrap_bio(come, goes)
    with raw(address) as bare:
        while True:
            try:
                secured.do_handshake()
                break
            except ssl.SSLWantReadError:
                bare.sendall(goes.read())
                come.write(bare.recv(4096))
        secured.write(STOP % b"now")
        bare.sendall(goes.read())
        come.write(bare.recv(4096))
        assert b'"held":true' in secured.read(4096)


def test_large_answers_and_streams_come_whole(come: Connect, bench: Bench) -> None:
    client = come("viewer")
    client.call("stream.start", modules=["component"], rate_hz=200)
    for _ in range(20):
        assert len(json_size(client)) > 0
        assert client.call("robot.describe")["parameters"]
    assert client.data()["columns"]


def json_size(client: Client) -> str:
    return str(client.call("resource.snapshot"))


# The robot's own key


def test_without_keys_nothing_of_tls_is_loaded(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(processes.RESTS_SOON, encoding="utf-8")
    script = (
        "import sys; from gateway.cli.serve import *; from gateway.daemon import Daemon\n"
        "from gateway.config import load; from pathlib import Path\n"
        f"Daemon(load(Path({str(tmp_path / 'robot.toml')!r})), listen('127.0.0.1', 0))\n"
        "names = ('ssl', '_ssl', 'subprocess', 'gateway.connections.tls', 'gateway.access.known_clients')\n"
        "print([one for one in names if one in sys.modules])"
    )
    ran = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True, check=True)
    assert ran.stdout == "[]\n"


def test_a_key_that_cannot_be_used_ends_the_start_and_is_not_told(bench: Bench, tmp_path: Path) -> None:
    keyed(tmp_path)
    secret = "MHcCAQEEISECRETSECRET"
    (tmp_path / "keys" / "robot.key").write_text(
        f"-----BEGIN EC PRIVATE KEY-----\n{secret}\n", encoding="ascii"
    )
    with listen("127.0.0.1", 0) as listener, pytest.raises(KeyProblem) as caught:
        Daemon(config(tmp_path), listener)
    assert str(tmp_path / "keys") in str(caught.value)
    assert secret not in f"{caught.value!r}{caught.value.__cause__!r}"


@pytest.mark.parametrize(("mode", "warned"), [(0o600, False), (0o640, False), (0o604, True)])
def test_a_key_that_everybody_may_read_is_warned_about(
    tmp_path: Path, mode: int, warned: bool, caplog: pytest.LogCaptureFixture
) -> None:
    folder = AccessFolder(keyed(tmp_path), {})
    folder.key.chmod(mode)
    context_of(folder, known_in(folder))
    assert bool([one for one in caplog.messages if "can be read by everybody" in one]) == warned


def test_an_empty_folder_of_keys_is_no_robot_without_keys(bench: Bench, tmp_path: Path) -> None:
    (tmp_path / "keys").mkdir()
    with listen("127.0.0.1", 0) as listener, pytest.raises(KeyProblem):
        Daemon(config(tmp_path), listener)


def test_the_service_manager_s_credentials_come_first(tmp_path: Path) -> None:
    (tmp_path / "robot.key").touch()
    assert AccessFolder(tmp_path / "etc", {"CREDENTIALS_DIRECTORY": str(tmp_path)}).keys == tmp_path
    assert AccessFolder(tmp_path / "etc", {}).keys == tmp_path / "etc" / "keys"


def test_keys_are_made_for_their_owner_alone(tmp_path: Path) -> None:
    key, certificate = tmp_path / "own" / "desk.key", tmp_path / "own" / "desk.crt"
    make("anna", key, certificate)
    assert [stat.S_IMODE(one.stat().st_mode) for one in (key.parent, key)] == [0o700, 0o600]
    with pytest.raises(KeyProblem, match="made once"):
        make("anna", key, certificate)


def test_a_gateway_that_rests_wakes_for_who_has_a_key_and_rests_again(tmp_path: Path) -> None:
    keyed(tmp_path)
    file = tmp_path / "robot.toml"
    file.write_text(processes.RESTS_SOON, encoding="utf-8")
    environ = {**os.environ, "XDG_STATE_HOME": str(tmp_path)}
    with processes.process(*processes.GATEWAY, str(file), environ=environ) as running:
        address = processes.address(running)
        for whose in ("viewer", "stranger", "viewer"):
            until(lambda: processes.rests(running.pid), "it rests")
            try:
                with KeyedClient(address, whose) as client:
                    assert client.call("clock.read")["boot_id"]
            except OSError:
                assert whose == "stranger"
        until(lambda: processes.rests(running.pid), "it rests again")
        with socket.create_connection(address) as bare:
            bare.sendall(b"{")
            assert said(bare) == b""


# What the journal says of it


def test_the_journal_says_who_is_let_in_and_who_no_more(come: Connect, tmp_path: Path) -> None:
    client = come("maintainer")

    def told() -> list[tuple[str, ...]]:
        entries = client.call("journal.tail", n=50)["entries"]
        return [(one["who"], one["what"], one["whom"], one["role"]) for one in entries if "whom" in one]

    assert set(told()) == {("gateway", "let in", f"client {name}", name) for name in keys.PEOPLE}
    shutil.copy(keys.pair("anna")[1], tmp_path / "clients" / "anna.crt")
    (tmp_path / "clients" / "viewer.crt").unlink()
    table = (tmp_path / "access.toml").read_text("utf-8")
    (tmp_path / "access.toml").write_text(table.replace('operator = "operator"', 'operator = "viewer"'))
    expected = {
        ("gateway", "let in", "client anna", "viewer"),
        ("gateway", "let in no more", "client viewer", "viewer"),
        ("gateway", "role changed from operator", "client operator", "viewer"),
    }
    until(lambda: set(told()) >= expected, "it is told")
    entries = client.call("journal.tail", n=50)["entries"]
    assert [one["key"] for one in entries if one.get("whom") == "client anna"] == [keys.pin("anna")]


def test_who_is_let_in_no_more_is_told_at_once_though_nobody_is_there(bench: Bench, tmp_path: Path) -> None:
    keyed(tmp_path)
    with serving(config(tmp_path, ROBOT.replace("linger_s = 0.05", "linger_s = 60"))) as address:
        with KeyedClient(address, "maintainer") as client:
            client.call("journal.tail", n=1)
        (tmp_path / "clients" / "operator.crt").unlink()
        (journal,) = tmp_path.rglob("journal.jsonl")
        until(lambda: "let in no more" in journal.read_text(encoding="utf-8"), "it is told")


def test_what_changed_while_no_gateway_ran_is_told_once(bench: Bench, tmp_path: Path) -> None:
    keyed(tmp_path)
    for times in range(3):
        with serving(config(tmp_path)) as address, KeyedClient(address, "maintainer") as client:
            entries = client.call("journal.tail", n=50)["entries"]
            told = [(one["what"], one["whom"]) for one in entries if "whom" in one]
        assert told.count(("let in", "client operator")) == 1
        assert told.count(("let in no more", "client operator")) == (times > 0)
        (tmp_path / "clients" / "operator.crt").unlink(missing_ok=True)


def test_a_robot_that_knows_nobody_has_nothing_to_tell(bench: Bench, tmp_path: Path) -> None:
    with serving(config(tmp_path)) as address, Client(address) as client:
        assert not any("whom" in one for one in client.call("journal.tail", n=50)["entries"])
    assert not list(tmp_path.rglob("admitted.json"))


def test_what_cannot_be_seen_keeps_no_module_from_starting(
    bench: Bench, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    def refuse(_folder: AccessFolder) -> list[Path]:
        raise PermissionError("no right")

    monkeypatch.setattr(AccessFolder, "files", refuse)
    with serving(config(tmp_path)) as address, Client(address) as client:
        assert client.call("robot.stop", reason="now")["held"] is True
    assert "who is let in cannot be seen" in caplog.text
