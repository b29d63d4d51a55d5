"""What a desk has kept of a journal finds what its own chain cannot: one made anew, cut, rolled back."""

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

import msgspec
import pytest

from gateway.access.folder import AccessFolder
from gateway.certificates import der_of, fingerprint
from gateway.main import main
from gateway.records.journal import Journal, Sizes, head_file
from gateway.records.signing import EMPTY, KEYLESS, HeadSigner
from gateway.records.witness import WitnessVerdict, judge
from gateway.wire.control import JournalProof, SignedHead
from tests.support.waiting import WAIT_S
from tests.unit.gateway import keyed as keys

INTACT, BROKEN, UNPROVEN = 0, 1, 3


def signer(folder: Path, whose: str = "robot") -> HeadSigner:
    """Of a robot with this key."""
    made = folder / "keys"
    made.mkdir(parents=True, exist_ok=True)
    for source, name in zip(keys.pair(whose), ("robot.key", "robot.crt"), strict=True):
        shutil.copy(source, made / name)
    return HeadSigner(AccessFolder(folder, {}), "exo-01")


def key(whose: str = "robot") -> str:
    return fingerprint(der_of(keys.pair(whose)[1].read_bytes()))


def written(path: Path, entries: Sequence[str], signing: HeadSigner) -> JournalProof:
    """Add these, and sign the newest."""
    journal = Journal(path, "boot")
    for what in entries:
        journal.append("tester", what)
    proof = journal.with_head(signing.proof).result(WAIT_S)
    journal.close()
    return proof


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "journal.jsonl"


@pytest.fixture
def seen(path: Path, tmp_path: Path) -> SignedHead:
    """Of a journal with three entries."""
    head = written(path, ["one", "two", "three"], signer(tmp_path)).head
    assert head is not None
    return head


def verify(path: Path, *witnesses: SignedHead, whose: str = "robot") -> int:
    file = path.with_name("witnesses")
    file.write_bytes(b"".join(msgspec.json.encode(each) + b"\n" for each in witnesses))
    return main(["journal", "verify", str(path), "--witness", str(file), "--key", key(whose), "--json"])


def said(capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def anew(path: Path, entries: Sequence[str], tmp_path: Path) -> None:
    """What root can do: a whole other chain, with its head."""
    path.unlink()
    head_file(path).unlink()
    written(path, entries, signer(tmp_path))


def test_a_journal_whose_newest_entry_was_seen_is_intact(path: Path, seen: SignedHead) -> None:
    assert verify(path, seen) == INTACT


def test_a_chain_that_was_rewritten_whole_is_broken(
    path: Path, seen: SignedHead, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    anew(path, ["one", "something else", "three", "four"], tmp_path)
    assert main(["journal", "verify", str(path), "--json"]) == UNPROVEN  # in itself it holds
    assert said(capsys)["verdict"] == "unproven"
    assert verify(path, seen) == BROKEN
    assert said(capsys)["at"] == 3


def test_what_was_rewritten_is_told_from_what_was_seen_before(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    signing = signer(tmp_path)
    first = written(path, ["one"], signing).head
    begin, head = path.read_bytes(), head_file(path).read_bytes()
    second = written(path, ["two"], signing).head
    path.write_bytes(begin)
    head_file(path).write_bytes(head)
    written(path, ["another"], signing)
    assert first is not None
    assert second is not None
    assert verify(path, second, first) == BROKEN
    found = said(capsys)
    assert (found["at"], found["witnessed"]) == (2, 1)


def test_a_journal_that_was_cut_with_its_head_is_broken(
    path: Path, seen: SignedHead, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also one that was rolled back: the witness is newer than the journal."""
    lines = path.read_bytes().splitlines(keepends=True)
    path.write_bytes(lines[0])
    head_file(path).unlink()
    assert verify(path, seen) == BROKEN
    assert said(capsys)["at"] == 2


def test_one_altered_entry_is_broken(
    path: Path, seen: SignedHead, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_bytes(path.read_bytes().replace(b'"two"', b'"2wo"'))
    assert verify(path, seen) == BROKEN
    assert said(capsys)["at"] == 2


def test_what_came_after_the_newest_witness_is_unproven(
    path: Path, seen: SignedHead, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written(path, ["four", "five"], signer(tmp_path))
    assert verify(path, seen) == UNPROVEN
    found = said(capsys)
    assert (found["at"], found["witnessed"]) == (4, 3)


def test_nobody_has_seen_it(path: Path, seen: SignedHead) -> None:
    assert main(["journal", "verify", str(path)]) == UNPROVEN
    assert verify(path) == UNPROVEN


def test_a_witness_of_another_robot_proves_nothing(
    path: Path, seen: SignedHead, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = written(tmp_path / "other.jsonl", ["one", "two", "three"], signer(tmp_path, "stranger")).head
    assert other is not None
    assert verify(path, other) == UNPROVEN
    assert "another robot" in str(said(capsys)["problems"])


def test_a_witness_is_no_proof_by_the_wrong_key(path: Path, seen: SignedHead) -> None:
    assert verify(path, seen, whose="stranger") == UNPROVEN


def test_who_has_not_the_key_cannot_make_a_witness(
    path: Path, seen: SignedHead, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The certificate is no secret, and neither are signatures of other entries."""
    anew(path, ["mine"], tmp_path)
    mine = written(path, [], signer(tmp_path, "stranger")).head
    assert mine is not None
    for signature in (mine.signature, seen.signature, "", "!", "AAAA", "AAAA" * 500):
        forged = msgspec.structs.replace(mine, certificate=seen.certificate, signature=signature)
        assert verify(path, forged) == UNPROVEN
    assert verify(path, msgspec.structs.replace(seen, certificate="none")) == UNPROVEN


def test_whose_key_it_is_is_said_or_it_proves_nothing(
    path: Path, seen: SignedHead, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CONFIG_HOME", str(tmp_path / "desk"))
    file = tmp_path / "witnesses"
    file.write_bytes(msgspec.json.encode(seen))
    command = ["journal", "verify", str(path), "--witness", str(file)]
    assert main(command) == UNPROVEN
    server = tmp_path / "desk" / "gwrms" / "server.toml"
    server.parent.mkdir(parents=True)
    server.write_text(f'[robots]\nexo-01 = {{ address = "192.0.2.7:7420", pin = "{key()}" }}\n')
    assert main(command) == INTACT
    server.write_text(f'[robots]\nexo-01 = {{ address = "192.0.2.7:7420", pin = "{key("stranger")}" }}\n')
    assert main(command) == UNPROVEN


def test_a_robot_without_a_key_or_with_nothing_to_sign_says_so(path: Path, tmp_path: Path) -> None:
    assert written(path, [], signer(tmp_path)).unsigned == EMPTY
    keyless = HeadSigner(AccessFolder(tmp_path / "nothing", {}), "exo-01")
    assert written(path, ["one"], keyless).unsigned == KEYLESS


def test_the_same_head_is_signed_once(path: Path, tmp_path: Path) -> None:
    signing = signer(tmp_path)
    head = written(path, ["one"], signing)
    assert written(path, [], signing) == head
    (tmp_path / "keys" / "robot.key").unlink()
    assert "cannot be read" in str(written(path, ["two"], signing).unsigned)


def test_what_was_seen_of_entries_that_are_removed_is_said(path: Path, seen: SignedHead) -> None:
    """And not that nobody has seen any."""
    journal = Journal(path, "boot", sizes=Sizes(piece=2000, kept=5000))
    for _ in range(60):
        journal.append("tester", "more").result(WAIT_S)
    journal.close()
    found = judge(path, [seen])
    assert (found.verdict, found.text) == (
        WitnessVerdict.UNPROVEN,
        "what others have seen of it ends with entry 3, which is removed",
    )
