"""A program with a window on a virtual screen, driven by xdotool's mouse and keyboard."""

import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import ImageGrab, features

SCREEN = (1300, 800)
# The window opens at the upper left corner of a screen without a window manager.
WINDOW = (960, 720)
PANEL_WIDTH = 316
PICTURE = (slice(0, WINDOW[1]), slice(0, WINDOW[0] - PANEL_WIDTH))
MIDDLE = ((WINDOW[0] - PANEL_WIDTH) // 2, WINDOW[1] // 2)
PATIENCE = 60.0
# The program says when it has nothing left to do; this is for events that are still on their way to it (seconds).
QUIET = 0.15


def why_not() -> str:
    """Say what a virtual screen lacks here, "" if there can be one."""
    if not sys.platform.startswith("linux"):
        return "no X server but on Linux"
    missing = [program for program in ("Xvfb", "xdotool") if shutil.which(program) is None]
    if not features.check("xcb"):
        missing.append("Pillow with XCB")
    return f"no {', '.join(missing)}" if missing else ""


@contextmanager
def virtual_screen() -> Iterator[str]:
    """Run an X server with a screen in memory, and give its name; it chooses a number that is free."""
    reader, writer = os.pipe()
    server = subprocess.Popen(
        ["Xvfb", "-displayfd", str(writer), "-screen", "0", f"{SCREEN[0]}x{SCREEN[1]}x24", "-nolisten", "tcp"],
        pass_fds=[writer],
        stderr=subprocess.DEVNULL,
    )
    os.close(writer)
    with os.fdopen(reader) as number:
        name = f":{number.readline().strip()}"
    try:
        yield name
    finally:
        server.terminate()
        server.wait(10.0)


@dataclass
class Frame:
    """A frame as `--verbose` reports it."""

    splats: int
    triangles: int
    silhouette: int

    @property
    def primitives(self) -> int:
        return self.splats + self.triangles


class Window:
    """A running program, its virtual mouse and keyboard, and what it says on standard error."""

    def __init__(self, display: str, folder: Path, *arguments: str, **environment: str) -> None:
        self.display, self.folder = display, folder
        self.environment = {**os.environ, "DISPLAY": display, **environment}
        self.frames: list[Frame] = []
        self.lines, self.idle = 0, False
        self.complaints: list[str] = []
        command = [sys.executable, "-m", "app.cli", "--verbose", "--resolution", "{},{}".format(*WINDOW), *arguments]
        self.process = subprocess.Popen(
            command,
            cwd=folder,
            env={**self.environment, "PYTHONPATH": str(Path(__file__).parents[2])},
            stderr=subprocess.PIPE,
            text=True,
        )
        self.listener = threading.Thread(target=self._listen, daemon=True)
        self.listener.start()

    def _listen(self) -> None:
        assert self.process.stderr is not None
        for line in self.process.stderr:
            # What the background keeps in the cache, and when, does not matter here.
            if line.startswith("cache: "):
                continue
            match = re.match(r"frame: (\d+) splats, (\d+) triangles, (\d+) silhouette", line)
            if match:
                self.frames.append(Frame(*map(int, match.groups())))
            elif line != "idle\n":
                self.complaints.append(line)
            self.idle = line == "idle\n"
            self.lines += 1

    def wait_until_idle(self, *, lines: int, frames: int) -> None:
        """Wait until the program has said so many lines, drawn so many frames, and has nothing left to do."""
        end = time.monotonic() + PATIENCE
        seen, since = -1, time.monotonic()
        while not self.idle or self.lines < lines or len(self.frames) < frames or time.monotonic() - since < QUIET:
            assert self.process.poll() is None, f"the window has gone: {self.complaints}"
            assert time.monotonic() < end, f"waited in vain for frame {frames}: {self.complaints}"
            if self.lines != seen:
                seen, since = self.lines, time.monotonic()
            time.sleep(0.01)

    def do(self, *arguments: object, draws: bool = True) -> Frame:
        """Let xdotool do something, wait for what is drawn thereupon, and return the last frame."""
        lines, frames = self.lines, len(self.frames)
        subprocess.run(["xdotool", *map(str, arguments)], env=self.environment, check=True)
        self.wait_until_idle(lines=lines + 1, frames=frames + draws)
        return self.frames[-1]

    def drag(self, start: tuple[int, int], end: tuple[int, int], button: int = 1, draws: bool = True) -> Frame:
        between = ((start[0] + end[0]) // 2, (start[1] + end[1]) // 2)
        moves = [word for place in (between, end) for word in ("mousemove", *place, "sleep", 0.05)]
        return self.do("mousemove", *start, "mousedown", button, "sleep", 0.05, *moves, "mouseup", button, draws=draws)

    def identity(self) -> str:
        """Return the X server's number of the window."""
        search = ["xdotool", "search", "--name", "Surfelscope"]
        return subprocess.run(search, env=self.environment, check=True, capture_output=True, text=True).stdout.split()[
            -1
        ]

    def look(self) -> np.ndarray:
        """Return the window as it is on the screen, int (720, 960, 3)."""
        return np.asarray(ImageGrab.grab((0, 0, *WINDOW), xdisplay=self.display).convert("RGB")).astype(int)

    def home(self) -> Frame:
        """Put the camera where it was at first."""
        self.do("mousemove", *MIDDLE, "key", "1")
        return self.do("key", "Home")

    def close(self) -> None:
        self.process.kill()
        self.process.wait(10.0)
        self.listener.join(10.0)
        assert self.process.stderr is not None
        self.process.stderr.close()
