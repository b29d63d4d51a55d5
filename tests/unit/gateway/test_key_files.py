"""Files of keys, clients and pins: changed by one process at a time, and secret where they must be."""

import contextlib
import fcntl
import os
import shutil
import ssl
import stat
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from gateway import key_making
from gateway.access import changes
from gateway.access.folder import AccessFolder
from gateway.access.known_clients import known_in
from gateway.certificates import KeyProblem, der_of
from gateway.client import Address, ClientError, NotPaired, WrongRobot
from gateway.client import pairing as desk
from gateway.client.keys import context_for, keys_folder, pins, server_file
from gateway.wire.role import Role
from tests.unit.gateway import keyed as keys
from tests.unit.gateway.keyed import keyed


def test_another_key_under_a_name_that_is_pinned_is_refused_loudly(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    desk.pin("exo-01", Address("192.0.2.7", 7420, "a" * 64))
    before = server_file().read_text("utf-8")
    for name, host in (("exo-01", "192.0.2.8"), ("exo-02", "192.0.2.7")):
        with pytest.raises(WrongRobot, match="IS PINNED TO ANOTHER KEY"):
            desk.pin(name, Address(host, 7420, "b" * 64))
    assert server_file().read_text("utf-8") == before


@pytest.mark.parametrize("line", ['"192.0.2.7:7420"', f'{{ address = "192.0.2.7", pin = "{"a" * 64}" }}'])
@pytest.mark.parametrize("says", ["exo-01", "exo 01", "-exo-01"])
def test_a_robot_that_says_it_is_another_one_does_not_get_its_line(
    says: str, line: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    server_file().parent.mkdir()
    server_file().write_text(f"[robots]\nexo-01 = {line}\n", encoding="utf-8")
    try:
        assert desk.pin(says, Address("192.0.2.9", 7420, "b" * 64)) == "exo-01-2"
    except WrongRobot:
        assert "pin" in line
    assert f"exo-01 = {line}\n" in server_file().read_text("utf-8")


def test_what_else_stands_in_the_server_s_file_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    server_file().parent.mkdir()
    server_file().write_text(
        '# ours\n[robots]\nleft = "192.0.2.7:7420"  # its own name\n[store]\nurl = "x"\n'
    )
    assert desk.pin("exo-01", Address("192.0.2.7", 7420, "a" * 64)) == "left"
    line = f'"left" = {{ address = "192.0.2.7:7420", pin = "{"a" * 64}" }}'
    assert server_file().read_text("utf-8") == f'# ours\n[robots]\n{line}\n[store]\nurl = "x"\n'
    server_file().write_text("[robots.exo-01]\naddress = '192.0.2.7'\n")
    with pytest.raises(ClientError, match="by hand"):
        desk.pin("exo-01", Address("192.0.2.7", 7420, "a" * 64))


def test_a_name_and_a_key_are_known_once(tmp_path: Path) -> None:
    folder, der = AccessFolder(tmp_path, {}), der_of(keys.pair("anna")[1].read_bytes())
    changes.add(folder, "anna", der, Role.VIEWER)
    for name, said in (
        ("anna", "anna is known already"),
        ("eve", "known already, as anna"),
        ("../x", "no name"),
    ):
        with pytest.raises(KeyProblem, match=said):
            changes.add(folder, name, der, Role.MAINTAINER)
    (who,) = known_in(folder).by_key.values()
    assert who.role is Role.VIEWER


def test_who_is_removed_is_nobody_and_the_table_is_as_before(tmp_path: Path) -> None:
    folder, der = AccessFolder(tmp_path, {}), der_of(keys.pair("anna")[1].read_bytes())
    changes.add(folder, "eve", der_of(keys.pair("eve")[1].read_bytes()), Role.VIEWER)
    before = folder.table.read_text("utf-8")
    changes.add(folder, "anna", der, Role.VIEWER)
    changes.remove(folder, "anna")
    assert folder.table.read_text("utf-8") == before
    assert [one.name for one in known_in(folder).by_key.values()] == ["eve"]
    with pytest.raises(KeyProblem, match="there is no anna; known are eve"):
        changes.remove(folder, "anna")


def test_who_is_removed_is_nobody_under_another_name_either(tmp_path: Path) -> None:
    folder = AccessFolder(keyed(tmp_path, {"anna": Role.OPERATOR, "eve": Role.VIEWER}), {})
    shutil.copy(folder.clients / "anna.crt", folder.clients / "zoe.crt")
    changes.remove(folder, "anna")
    assert [one.name for one in known_in(folder).by_key.values()] == ["eve"]


def test_nothing_is_removed_but_a_client(tmp_path: Path) -> None:
    folder = AccessFolder(keyed(tmp_path), {})
    with pytest.raises(KeyProblem, match="there is no"):
        changes.remove(folder, "../keys/robot")
    assert folder.certificate.exists()


def test_what_is_no_certificate_is_known_for_none_in_no_time(tmp_path: Path) -> None:
    """Whoever reaches the port may send it; where it took the square of its length, it took minutes."""
    with pytest.raises(KeyProblem):
        der_of(b"-----BEGIN CERTIFICATE-----" + b" " * 400_000)


# The robot's first key is its own once its first desk is let in


def der(name: str) -> bytes:
    return der_of(keys.pair(name)[1].read_bytes())


def begun(path: Path) -> tuple[AccessFolder, str]:
    """A pairing that has shown the robot's key, and that key."""
    shown = changes.ensure_keys(AccessFolder(path, {}), "exo-01")
    return shown, changes.own_fingerprint(shown)


def test_a_pairing_that_lets_nobody_in_leaves_the_robot_without_keys(tmp_path: Path) -> None:
    """It left keys, and a gateway that woke let nobody in who could stop the robot before."""
    _, own = begun(tmp_path)
    assert not AccessFolder(tmp_path, {}).has_keys
    assert begun(tmp_path)[1] == own, "the next one goes on with the same key"


def test_the_first_desk_gives_the_robot_its_key_and_the_second_changes_it_not(tmp_path: Path) -> None:
    shown, own = begun(tmp_path)
    assert changes.admit(shown, own, "anna", der("anna"), Role.OPERATOR)
    folder = AccessFolder(tmp_path, {})
    assert (folder.has_keys, changes.own_fingerprint(folder), shown.keys.exists()) == (True, own, False)
    assert stat.S_IMODE(folder.keys.stat().st_mode) == 0o700
    assert not changes.admit(*begun(tmp_path), "eve", der("eve"), Role.VIEWER)
    assert changes.own_fingerprint(folder) == own


def test_two_that_pair_at_once_are_both_let_in_by_the_same_key(tmp_path: Path) -> None:
    one, other = begun(tmp_path), begun(tmp_path)
    assert changes.admit(*one, "anna", der("anna"), Role.OPERATOR)
    assert not changes.admit(*other, "eve", der("eve"), Role.VIEWER)
    assert changes.own_fingerprint(AccessFolder(tmp_path, {})) == one[1] == other[1]


def test_a_desk_that_has_seen_another_key_is_not_let_in(tmp_path: Path) -> None:
    shown, own = begun(tmp_path)
    shutil.rmtree(shown.keys)
    with pytest.raises(KeyProblem, match="cannot be read"):
        changes.admit(shown, own, "anna", der("anna"), Role.OPERATOR)
    keyed(tmp_path, {})
    with pytest.raises(KeyProblem, match=r"another key .* meanwhile; pair again"):
        changes.admit(shown, own, "anna", der("anna"), Role.OPERATOR)
    assert known_in(shown).by_key == {}


@pytest.mark.parametrize("where", ["_add", "_publish"])
def test_who_is_killed_while_the_first_desk_is_let_in_leaves_no_key_that_lets_nobody_in(
    where: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Killed(BaseException):
        """As by kill -9: nothing more of the command runs."""

    def killed(*_: object) -> None:
        raise Killed

    shown, own = begun(tmp_path)
    as_it_is = getattr(changes, where)
    monkeypatch.setattr(changes, where, killed)
    with pytest.raises(Killed):
        changes.admit(shown, own, "anna", der("anna"), Role.OPERATOR)
    monkeypatch.setattr(changes, where, as_it_is)
    folder = AccessFolder(tmp_path, {})
    assert not folder.has_keys
    if where == "_publish":
        changes.remove(folder, "anna")  # as the message says that pairing her again gives
    assert changes.admit(*begun(tmp_path), "anna", der("anna"), Role.OPERATOR)


def test_where_the_key_cannot_be_put_in_its_place_nobody_is_let_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shown, own = begun(tmp_path)

    def full(_self: Path, _to: Path) -> Path:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(changes, "_add", lambda *_: shutil.copy(keys.pair("anna")[1], _clients(tmp_path)))
    monkeypatch.setattr(Path, "rename", full)
    with pytest.raises(KeyProblem, match="keys cannot be made: No space left"):
        changes.admit(shown, own, "anna", der("anna"), Role.OPERATOR)
    assert (shown.files(), AccessFolder(tmp_path, {}).has_keys) == ([], False)


def _clients(folder: Path) -> Path:
    (folder / "clients").mkdir()
    return folder / "clients" / "anna.crt"


# Two at once, and what others may not read


def test_two_that_begin_at_once_make_one_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without it, the certificate of one lay beside the key of the other."""
    both = threading.Barrier(2)
    was = key_making._new_key

    def made() -> bytes:
        with contextlib.suppress(threading.BrokenBarrierError):
            both.wait(0.2)  # both are in it, where nothing keeps the second out
        return was()

    monkeypatch.setattr(key_making, "_new_key", made)
    folder = AccessFolder(tmp_path, {})
    with ThreadPoolExecutor(2) as pool:
        begun = [pool.submit(changes.ensure_keys, folder, "exo-01") for _ in range(2)]
        one, other = (found.result() for found in begun)
    assert one.key == other.key
    ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(one.certificate, one.key)


def test_who_was_killed_between_key_and_certificate_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    folder = changes.ensure_keys(AccessFolder(tmp_path, {}), "exo-01")
    desk.own_certificate()
    own = keys_folder() / "desk.key", keys_folder() / "desk.crt"
    before = folder.key.read_bytes(), own[0].read_bytes()
    for left_out in (folder.certificate, own[1]):
        left_out.unlink()
    assert changes.ensure_keys(folder, "exo-01").key == folder.key
    desk.own_certificate()
    assert (folder.key.read_bytes(), own[0].read_bytes()) == before, "who is known by it stays known"
    for key, certificate in ((folder.key, folder.certificate), own):
        ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER).load_cert_chain(certificate, key)


def test_a_folder_that_another_program_keeps_locked_keeps_nobody_in(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whoever may read it may lock it, and could have made every command wait for ever."""
    monkeypatch.setattr(key_making, "_TURN_S", 0.0)
    folder = AccessFolder(keyed(tmp_path, {"anna": Role.OPERATOR}), {})
    descriptor = os.open(tmp_path, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX)
        with pytest.raises(KeyProblem, match=f"another program keeps {tmp_path} locked"):
            changes.ensure_keys(folder, "exo-01")
        with pytest.raises(KeyProblem, match="anna is no longer admitted, but its role is still in the file"):
            changes.remove(folder, "anna")
    finally:
        os.close(descriptor)
    assert known_in(folder).by_key == {}


def test_clients_can_be_read_by_the_gateway_whatever_the_mask_and_else_it_is_said(tmp_path: Path) -> None:
    folder = AccessFolder(tmp_path, {})
    mask = os.umask(0o077)
    try:
        changes.add(folder, "anna", der_of(keys.pair("anna")[1].read_bytes()), Role.VIEWER)
    finally:
        os.umask(mask)
    assert [stat.S_IMODE(one.stat().st_mode) for one in (folder.clients, folder.table)] == [0o755, 0o644]
    assert known_in(folder).problems == ()
    shutil.rmtree(folder.clients)
    folder.clients.write_text("no folder")
    assert "nobody whose certificate is there is let in" in "".join(known_in(folder).problems)


def test_a_link_to_a_key_whose_place_others_could_take_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    desk.own_certificate()
    open_ = tmp_path / "open"
    open_.mkdir()
    (keys_folder() / "desk.key").rename(open_ / "desk.key")
    (keys_folder() / "desk.key").symlink_to(open_ / "desk.key")
    desk.own_certificate()
    open_.chmod(0o777)
    with pytest.raises(KeyProblem, match=f"chmod go-w {open_}$"):
        desk.own_certificate()


def test_two_that_are_let_in_at_once_both_have_their_role(tmp_path: Path) -> None:
    folder = AccessFolder(tmp_path, {})
    names = [f"anna-{number}" for number in range(4)]
    ders = {name: der_of(keys.pair(name)[1].read_bytes()) for name in names}
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda name: changes.add(folder, name, ders[name], Role.OPERATOR), names))
    assert {who.name: who.role for who in known_in(folder).by_key.values()} == dict.fromkeys(
        names, Role.OPERATOR
    )


def test_two_robots_that_are_paired_at_once_are_both_pinned(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    where = [Address(f"192.0.2.{number}", 7420, f"{number}" * 64) for number in range(1, 5)]
    with ThreadPoolExecutor(4) as pool:
        list(pool.map(lambda one: desk.pin(f"exo-{one.host}", one), where))
    assert pins() == {one.pin for one in where}


@pytest.mark.parametrize(
    ("wide", "mode", "helps"), [("desk.key", 0o640, "chmod 600"), (".", 0o750, "chmod 700")]
)
def test_a_key_that_others_can_read_is_not_used(
    wide: str, mode: int, helps: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path))
    desk.own_certificate()
    one = keys_folder() / wide
    one.chmod(mode)
    with pytest.raises(KeyProblem, match=f"open to others.*{helps} {one.resolve()}$"):
        desk.own_certificate()
    with pytest.raises(NotPaired, match=f"{helps} {one.resolve()}$"):
        context_for(Address("192.0.2.7", 7420), "a" * 64)
    subprocess.run([*helps.split(), one], check=True)
    context_for(Address("192.0.2.7", 7420), "a" * 64)


@pytest.mark.parametrize(
    "code",
    [
        "main(['pair', '192.0.2.7', 'no-code'])",
        "main(['keys', 'pair', '/no/robot.toml', '--name', 'x', '--role', 'viewer', '--yes'])",
        "context_for(Address('192.0.2.7'), 'a' * 64)",
    ],
)
def test_what_holds_a_key_or_a_code_leaves_no_dump(code: str, tmp_path: Path) -> None:
    lines = [
        "import contextlib, resource",
        "from gateway.client import Address",
        "from gateway.client.keys import context_for",
        "from gateway.main import main",
        "hard = resource.getrlimit(resource.RLIMIT_CORE)[1]",
        "resource.setrlimit(resource.RLIMIT_CORE, (hard, hard))",
        f"with contextlib.suppress(SystemExit, OSError): {code}",
        "print(resource.getrlimit(resource.RLIMIT_CORE))",
    ]
    ran = subprocess.run(
        [sys.executable, "-c", "\n".join(lines)],
        env={**os.environ, "XDG_CONFIG_HOME": str(tmp_path)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert ran.stdout == "(0, 0)\n"
