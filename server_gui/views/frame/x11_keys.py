"""STOP keys taken from the X server in a thread of their own, so that a window that is busy delays no STOP.

Qt hears of a key when its thread has time. Here a second connection to the X server grabs the keys on our
window (core protocol, `XGrabKey`), and the thread that reads it sends the STOP itself. Where there is no X
server, or another program has grabbed the keys, Qt's way remains.
"""

import ctypes
import math
import os
import select
import time
from collections.abc import Callable
from typing import Final, Self

from server_gui.core.threads.supervision import Worker

F12, SPACE = 0xFFC9, 0x0020  # keysyms
SHIFT, CONTROL, CAPS_LOCK, NUM_LOCK = 0x01, 0x04, 0x02, 0x10
KEYS: Final = ((F12, 0), (F12, SHIFT), (SPACE, CONTROL))  # with shift: of every robot
LOCKS: Final = (0, CAPS_LOCK, NUM_LOCK, CAPS_LOCK | NUM_LOCK)
GRAB_ASYNC: Final = 1
KEY_PRESS: Final = 2
HELD_S: Final = 0.2  # presses of a key that follow each other so quickly are one that is held down


class NoX(Exception):
    """There is no X server, or not the libraries to speak to it."""


class _Event(ctypes.Structure):
    """`xcb_key_press_event_t`, up to the modifiers."""

    _fields_ = [
        ("response_type", ctypes.c_uint8),
        ("keycode", ctypes.c_uint8),
        ("sequence", ctypes.c_uint16),
        ("time", ctypes.c_uint32),
        ("windows", ctypes.c_uint32 * 3),
        ("places", ctypes.c_int16 * 4),
        ("modifiers", ctypes.c_uint16),
    ]


class X11Keys:
    """Watches STOP keys of one window; `pressed`, or `all_pressed`, is called in its own thread.

    Use it as a context manager.
    """

    def __init__(self, window: int, pressed: Callable[[], None], all_pressed: Callable[[], None]) -> None:
        self._window = window
        self._called = {False: pressed, True: all_pressed}  # by whether shift is held
        self._xcb = _library("libxcb.so.1")
        self._connection = _connect(self._xcb)
        self._end = os.pipe()
        self._last_s: dict[tuple[int, bool], float] = {}  # of each key, with and without shift
        self.worker = Worker("stop keys", self._watch, math.inf)  # it waits for a key, as long as it takes

    def __enter__(self) -> Self:
        self._grab()
        self.worker.start()
        return self

    def __exit__(self, *exc: object) -> None:
        os.write(self._end[1], b".")
        self.worker.join()
        self._xcb.xcb_disconnect(self._connection)
        for descriptor in self._end:
            os.close(descriptor)

    def _grab(self) -> None:
        keysyms = _library("libxcb-keysyms.so.1")
        keysyms.xcb_key_symbols_alloc.restype = ctypes.c_void_p
        keysyms.xcb_key_symbols_get_keycode.restype = ctypes.POINTER(ctypes.c_uint8)
        table = ctypes.c_void_p(keysyms.xcb_key_symbols_alloc(self._connection))
        for keysym, modifiers in KEYS:
            codes = keysyms.xcb_key_symbols_get_keycode(table, ctypes.c_uint32(keysym))
            if codes and codes[0]:
                self._grab_code(codes[0], modifiers)
            _free(codes)
        keysyms.xcb_key_symbols_free(table)
        self._xcb.xcb_flush(self._connection)

    def _grab_code(self, code: int, modifiers: int) -> None:
        for locks in LOCKS:
            self._xcb.xcb_grab_key(
                self._connection,
                ctypes.c_uint8(0),
                ctypes.c_uint32(self._window),
                ctypes.c_uint16(modifiers | locks),
                ctypes.c_uint8(code),
                ctypes.c_uint8(GRAB_ASYNC),
                ctypes.c_uint8(GRAB_ASYNC),
            )

    def _watch(self) -> None:
        server = self._xcb.xcb_get_file_descriptor(self._connection)
        while not self._xcb.xcb_connection_has_error(self._connection):
            self._take_events()
            ready, _, _ = select.select([server, self._end[0]], [], [])
            if self._end[0] in ready:
                return

    def _take_events(self) -> None:
        while event := self._xcb.xcb_poll_for_event(self._connection):
            kind, code = event.contents.response_type & 0x7F, event.contents.keycode
            of_all = bool(event.contents.modifiers & SHIFT)
            _free(event)
            if kind == KEY_PRESS:
                self._press(code, of_all=of_all)

    def _press(self, code: int, *, of_all: bool) -> None:
        now_s, key = time.monotonic(), (code, of_all)
        held = now_s - self._last_s.get(key, 0.0) < HELD_S
        self._last_s[key] = now_s
        if not held:
            self._called[of_all]()


def _library(name: str) -> ctypes.CDLL:
    try:
        return ctypes.CDLL(name)
    except OSError as error:
        raise NoX(f"{name} is not there") from error


def _connect(xcb: ctypes.CDLL) -> ctypes.c_void_p:
    xcb.xcb_connect.restype = ctypes.c_void_p
    xcb.xcb_poll_for_event.restype = ctypes.POINTER(_Event)
    connection = ctypes.c_void_p(xcb.xcb_connect(None, None))
    if xcb.xcb_connection_has_error(connection):
        xcb.xcb_disconnect(connection)
        raise NoX("no X server answers")
    return connection


def _free(found: object) -> None:
    ctypes.CDLL(None).free(found)
