"""What a CAN server sends: messages between brackets, and frames in them."""

from drivers.bus.frames import ERROR, EXTENDED
from drivers.bus.interfaces.socketcand import MAX_PENDING, SocketcandParser, frame_of, send_message

TOKENS = (
    b"< frame ",
    b"181 ",
    b"1FFFFFFF ",
    b"1.0 ",
    b"0102 ",
    b">",
    b"< error ",
    b"< hi >",
    b"< ok >",
    b"-1 ",
)
MODULES = ("drivers.bus.interfaces.socketcand",)


def fuzz(data: bytes) -> None:
    text = data.decode("ascii", errors="replace")
    whole, cut = SocketcandParser(), SocketcandParser()
    messages = whole.feed(text)
    assert len(text) > MAX_PENDING or messages == [one for letter in text for one in cut.feed(letter)]
    for message in messages:
        frame = frame_of(message, 7)
        if frame is not None:
            _check(*frame)


def _check(stamp_ns: int, can_id: int, data: bytes) -> None:
    assert stamp_ns == 7
    assert len(data) <= 8
    if can_id & ERROR:  # which comes, and is never sent
        assert 0 < can_id < 2 * ERROR
        assert not data
        return
    assert 0 <= can_id <= 0x7FF or (can_id & EXTENDED and 0 <= can_id - EXTENDED <= 0x1FFF_FFFF)
    (sent,) = SocketcandParser().feed(send_message(can_id, data))
    _, identifier, _, *raw = sent.split()
    assert frame_of(f" frame {identifier} 1.0 {''.join(raw)} ", 7) == (7, can_id, data), "sent otherwise"
