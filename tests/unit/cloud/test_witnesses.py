"""A desk that collects a journal keeps what the robot has signed of it, and gives that out again."""

import asyncio
from pathlib import Path
from typing import Any, cast

import msgspec
import pytest

from gateway.certificates import KeyProblem, der_of, fingerprint
from gateway.client import Address, Client, RemoteError
from gateway.main import main
from gateway.records.chain import Head
from gateway.records.journal import read_verified
from gateway.wire import framing
from gateway.wire.control import JournalProof, SignedHead
from server_gui.core.cloud.witnesses import witnesses
from server_gui.core.follow.events import Journalled
from server_gui.core.follow.journal_witness import signed_head
from server_gui.core.follow.validation import Unfit, Validator
from server_gui.core.recording.recorder import Recorder
from server_gui.core.recording.spool import Spool
from tests.support.journals import RobotsJournal
from tests.support.waiting import WAIT_S
from tests.unit.gateway import keyed as keys
from tests.unit.records.test_witness import signer


@pytest.fixture
def journal(tmp_path: Path) -> Any:
    made = RobotsJournal(tmp_path)
    yield made
    made.close()


def signed(tmp_path: Path) -> SignedHead:
    """The newest entry."""
    entry = read_verified(tmp_path / "journal.jsonl")[-1]
    head = signer(tmp_path / "robot").proof(Head(entry["n"], entry["hash"])).head
    assert head is not None
    return head


def pinned(whose: str) -> Address:
    pin = fingerprint(der_of(keys.pair(whose)[1].read_bytes()))
    return Address("192.0.2.7", 7420, pin)


class Robot:
    """Answers `journal.head` alone."""

    def __init__(self, answer: JournalProof | Exception) -> None:
        self.answer = answer

    async def journal_head(self) -> JournalProof:
        if isinstance(self.answer, Exception):
            raise self.answer
        return self.answer


def asked(answer: JournalProof | Exception, address: Address) -> SignedHead | None:
    return asyncio.run(signed_head(cast("Client", Robot(answer)), address))


def test_each_signed_head_is_kept_with_its_entry_once_and_told_again(
    tmp_path: Path, journal: RobotsJournal, capsys: pytest.CaptureFixture[str]
) -> None:
    spool, heads = tmp_path / "spool", []
    with Spool(spool) as open_, Recorder(open_) as recorder:
        for what in ("one", "two"):
            journal.say(what)
            heads.append(signed(tmp_path))
            for _ in range(2):
                recorder.journal("exo-01", journal.told().journal.entries, heads[-1])
            assert recorder.flush(WAIT_S)
    assert witnesses(None, spool, "exo-01") == heads
    assert witnesses(None, spool, "exo-02") == []
    config = tmp_path / "server.toml"
    config.write_text(f'[recorder]\nspool = "{spool}"\n[store]\nurl = "{(tmp_path / "store").as_uri()}"\n')
    assert main(["cloud", "witnesses", "exo-01", "--config", str(config)]) == 0
    file = tmp_path / "witnesses"
    file.write_text(capsys.readouterr().out)
    own = fingerprint(der_of(keys.pair("robot")[1].read_bytes()))
    verify = ["journal", "verify", str(tmp_path / "journal.jsonl"), "--witness", str(file), "--key", own]
    assert main(verify) == 0
    assert main(["cloud", "witnesses", "exo-02", "--config", str(config)]) == 1


def test_an_entry_that_was_kept_before_it_was_signed_is_kept_again(
    tmp_path: Path, journal: RobotsJournal
) -> None:
    journal.say("one")
    head = signed(tmp_path)
    with Spool(tmp_path / "spool") as open_, Recorder(open_) as recorder:
        for seen in (None, head, head):
            recorder.journal("exo-01", journal.told().journal.entries, seen)
        assert recorder.flush(WAIT_S)
    assert witnesses(None, tmp_path / "spool", "exo-01") == [head]


def test_what_another_key_has_signed_than_was_paired_is_no_witness(
    tmp_path: Path, journal: RobotsJournal
) -> None:
    journal.say("one")
    proof = JournalProof(signed(tmp_path))
    assert asked(proof, pinned("robot")) == proof.head
    with pytest.raises(Unfit, match="of another robot"):
        asked(proof, pinned("stranger"))
    assert proof.head is not None
    other = msgspec.structs.replace(proof.head, n=7)
    with pytest.raises(Unfit, match="does not hold"):
        asked(JournalProof(other), pinned("robot"))
    with pytest.raises(Unfit, match="another entry 1"):
        Validator().check(Journalled(journal.told().journal, msgspec.structs.replace(proof.head, hash="0")))


def test_a_robot_without_keys_or_from_before_has_no_witness_and_is_recorded() -> None:
    assert asked(JournalProof(unsigned="no key"), pinned("robot")) is None
    unknown = RemoteError(framing.METHOD_NOT_FOUND, "there is no such method")
    assert asked(unknown, pinned("robot")) is None


def test_without_the_program_nobody_can_say(
    tmp_path: Path, journal: RobotsJournal, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal.say("one")
    proof = JournalProof(signed(tmp_path))
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(KeyProblem, match="openssl"):
        asked(proof, pinned("robot"))
