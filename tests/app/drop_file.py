"""Drop a file on a window of an X server, as a file manager does: python drop_file.py WINDOW PATH.

The source's side of the XDND protocol, version 5, with nothing but libX11: announce, point, wait until the window
accepts, drop, hand over the path as text/uri-list, and wait until the window has finished.
"""

import ctypes
import sys
import time
from ctypes import byref, c_char_p, c_int, c_long, c_ulong, c_void_p
from pathlib import Path

CLIENT_MESSAGE, SELECTION_REQUEST, SELECTION_NOTIFY = 33, 30, 31
PATIENCE = 10.0


class ClientMessage(ctypes.Structure):
    _fields_ = (
        ("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p), ("window", c_ulong),
        ("message_type", c_ulong), ("format", c_int), ("data", c_long * 5),
    )  # fmt: skip


class SelectionRequest(ctypes.Structure):
    _fields_ = (
        ("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p), ("owner", c_ulong),
        ("requestor", c_ulong), ("selection", c_ulong), ("target", c_ulong), ("property", c_ulong), ("time", c_ulong),
    )  # fmt: skip


class SelectionNotify(ctypes.Structure):
    _fields_ = (
        ("type", c_int), ("serial", c_ulong), ("send_event", c_int), ("display", c_void_p), ("requestor", c_ulong),
        ("selection", c_ulong), ("target", c_ulong), ("property", c_ulong), ("time", c_ulong),
    )  # fmt: skip


class Event(ctypes.Union):
    _fields_ = (
        ("type", c_int), ("message", ClientMessage), ("request", SelectionRequest), ("notify", SelectionNotify),
        ("padding", c_long * 24),
    )  # fmt: skip


class Source:
    """The window that the file is dragged from."""

    def __init__(self, target: int) -> None:
        self.x = ctypes.CDLL("libX11.so.6")
        self.x.XOpenDisplay.restype = c_void_p
        self.x.XInternAtom.restype = self.x.XCreateSimpleWindow.restype = self.x.XDefaultRootWindow.restype = c_ulong
        self.display = c_void_p(self.x.XOpenDisplay(None))
        root = c_ulong(self.x.XDefaultRootWindow(self.display))
        none = c_ulong(0)
        self.window = self.x.XCreateSimpleWindow(self.display, root, 0, 0, 1, 1, 0, none, none)
        self.target = target

    def atom(self, name: str) -> int:
        return self.x.XInternAtom(self.display, name.encode(), 0)

    def send(self, window: int, event: Event) -> None:
        self.x.XSendEvent(self.display, c_ulong(window), 0, c_long(0), byref(event))
        self.x.XFlush(self.display)

    def tell(self, message: str, *data: int) -> None:
        event = Event()
        event.message.type, event.message.window, event.message.format = CLIENT_MESSAGE, self.target, 32
        event.message.message_type = self.atom(message)
        event.message.data[:] = [self.window, *data, *[0] * (4 - len(data))]
        self.send(self.target, event)

    def wait_for(self, message: str, path: Path) -> Event:
        """Wait for the window's answer, and hand the path over when it asks for it."""
        end, event = time.monotonic() + PATIENCE, Event()
        while time.monotonic() < end:
            if not self.x.XPending(self.display):
                time.sleep(0.005)
                continue
            self.x.XNextEvent(self.display, byref(event))
            if event.type == SELECTION_REQUEST:
                self.hand_over(event.request, path)
            elif event.type == CLIENT_MESSAGE and event.message.message_type == self.atom(message):
                return event
        sys.exit(f"the window did not answer with {message}")

    def hand_over(self, request: SelectionRequest, path: Path) -> None:
        text = f"{path.as_uri()}\r\n".encode()
        self.x.XChangeProperty(
            self.display, c_ulong(request.requestor), c_ulong(request.property), c_ulong(request.target), 8, 0,
            c_char_p(text), len(text),
        )  # fmt: skip
        answer = Event()
        answer.notify.type, answer.notify.requestor = SELECTION_NOTIFY, request.requestor
        answer.notify.selection, answer.notify.target = request.selection, request.target
        answer.notify.property, answer.notify.time = request.property, request.time
        self.send(request.requestor, answer)

    def drop(self, path: Path, x: int, y: int) -> None:
        selection, now = self.atom("XdndSelection"), 0
        self.x.XSetSelectionOwner(self.display, c_ulong(selection), c_ulong(self.window), c_ulong(now))
        self.tell("XdndEnter", 5 << 24, self.atom("text/uri-list"))
        self.tell("XdndPosition", 0, x << 16 | y, now, self.atom("XdndActionCopy"))
        answer = self.wait_for("XdndStatus", path)
        if not answer.message.data[1] & 1:
            sys.exit("the window does not take files")
        self.tell("XdndDrop", 0, now)
        self.wait_for("XdndFinished", path)


if __name__ == "__main__":
    Source(int(sys.argv[1])).drop(Path(sys.argv[2]).resolve(), 300, 300)
