"""Ask a window of an X server to close, as a window manager does: python close_window.py WINDOW."""

import ctypes
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "app"))
from drop_file import CLIENT_MESSAGE, Event, Source

if __name__ == "__main__":
    source = Source(int(sys.argv[1]))
    event = Event()
    event.message.type, event.message.window, event.message.format = CLIENT_MESSAGE, source.target, 32
    event.message.message_type = source.atom("WM_PROTOCOLS")
    event.message.data[0] = source.atom("WM_DELETE_WINDOW")
    source.send(source.target, event)
    source.x.XSync(source.display, ctypes.c_int(0))
