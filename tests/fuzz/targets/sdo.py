"""SDO transfers whose device answers anything: they end, with data or with an error of the protocol."""

import contextlib

from drivers.bus.sdo import protocol
from drivers.bus.sdo.answers import INBOX, Answers, SdoCounters
from drivers.bus.sdo.outstanding import Outstanding
from drivers.bus.sdo.round_trips import RoundTrips

TOKENS = (
    b"\x43\x41\x60\0",
    b"\x41\x08\x10\0\x0a\0\0\0",
    b"\x60\x41\x60\0",
    b"\x80\x41\x60\0",
    b"\x01",
    b"\x11",
)
MODULES = ("drivers.bus.sdo.protocol", "drivers.bus.sdo.outstanding", "drivers.bus.sdo.answers")


def fuzz(data: bytes) -> None:
    responses = [data[at : at + 8] for at in range(0, len(data) - 7, 8)]
    with contextlib.suppress(protocol.SdoAborted, protocol.SdoProtocolError):
        _play(protocol.upload(0x6041, 0), responses)
    with contextlib.suppress(protocol.SdoAborted, protocol.SdoProtocolError):
        _play(protocol.download(0x6041, 0, bytes(20)), responses)
    _assign(responses)


def _play(steps: protocol.Upload | protocol.Download, responses: list[bytes]) -> None:
    """As the channel does it: what cannot be the answer is not handed over."""
    try:
        request = next(steps)
        for response in responses:
            if protocol.answers(response, request, protocol.multiplexer(0x6041, 0)):
                request = steps.send(response)
                assert len(request) == 8
    except StopIteration as done:
        assert done.value is None or len(done.value) <= max(4, 7 * len(responses))


def _assign(responses: list[bytes]) -> None:
    """What is asked for by one of these is settled at most once; the rest is counted."""
    counters, outstanding = SdoCounters(), Outstanding()
    answers = Answers(outstanding, counters, RoundTrips(0.5))
    asked = [
        outstanding.add(protocol.multiplexer(0x6041, 0), next(protocol.upload(0x6041, 0))) for _ in range(3)
    ]
    for stamp_ns, response in enumerate(responses):
        answers.put(stamp_ns, response)
    answers.fetch_waiting()
    settled = sum(request.answer is not None for request in asked)
    assert settled + counters.stale <= min(INBOX, len(responses))
    assert counters.dropped == max(0, len(responses) - INBOX)
