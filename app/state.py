"""What the user can change while looking, and what the panel shows of it."""

from __future__ import annotations

import math
import time
from collections import deque
from dataclasses import dataclass, field

from renderer.settings import Settings

# Frames that the graph shows.
HISTORY = 120

# The stages of a frame, in the order in which they run and are stacked in the graph.
STAGES = ("select", "visibility", "attributes", "resolve")


@dataclass(frozen=True)
class FrameReport:
    """What a drawn frame consisted of and took.

    milliseconds : one number for each of STAGES
    total : milliseconds from the start of the selection until the GPU had finished
    missing : splats whose tiles had not been baked yet
    texels : along one side of the tiles that it was drawn with, 0: none
    """

    splats: int
    triangles: int
    silhouette: int
    visited: int
    milliseconds: tuple[float, float, float, float]
    total: float
    missing: int = 0
    texels: int = 0


@dataclass(frozen=True)
class Message:
    """A line that the window shows until `until` (seconds of time.monotonic); inf: until it is clicked away."""

    text: str
    is_error: bool
    until: float


@dataclass(frozen=True)
class Steered:
    """What the goals have made of the sliders' values.

    r_sil, r_inner : pixels, of a picture at rest
    texels : along one side of a tile; the tiles in use may still be others
    promise : upper bounds of the error at rest in degrees and pixels, None: not known
    coarseness : by how much the radii are multiplied while the camera moves, at least 1
    """

    r_sil: float
    r_inner: float
    texels: int
    promise: tuple[float, float] | None = None
    coarseness: float = 1.0


@dataclass
class ViewerState:
    """Everything that the panel edits or shows, apart from the scene itself.

    r_sil, r_inner : pixels, as chosen
    texels : along one side of a tile, as chosen; the tiles in use may still be others
    limit_error : let radii and tiles follow from max_degrees and max_pixels
    hold_rate : coarsen while the camera moves, so that frames_per_second are drawn
    orthographic : whether the view rays are parallel; what the panel shows of the camera
    printed_cone_test : tell the silhouette by the test as the paper prints it
    steered : what is drawn with, None: nothing has been drawn yet
    continuous : draw again and again, to measure
    ui_scale : size of the panel's letters over their usual size
    """

    r_sil: float = 2.0
    r_inner: float = 16.0
    texels: int = 16
    settings: Settings = field(default_factory=Settings)
    limit_error: bool = False
    max_degrees: float = 1.0
    max_pixels: float = 0.5
    hold_rate: bool = False
    frames_per_second: float = 30.0
    orthographic: bool = False
    printed_cone_test: bool = False
    steered: Steered | None = None
    show_panel: bool = True
    show_help: bool = False
    continuous: bool = False
    history: deque[FrameReport] = field(default_factory=lambda: deque(maxlen=HISTORY))
    messages: list[Message] = field(default_factory=list)

    # Long enough to read.
    MESSAGE_SECONDS = 4.0
    # A reader of files may have an essay to say.
    LONGEST_TEXT = 400

    def say(self, text: str, *, is_error: bool = False) -> None:
        """Show a line for a while, or, of an error, until it is dismissed or another one takes its place."""
        text = " ".join(text.split())
        if len(text) > self.LONGEST_TEXT:
            text = f"{text[: self.LONGEST_TEXT]}..."
        if is_error:
            self.dismiss_error()
        until = math.inf if is_error else time.monotonic() + self.MESSAGE_SECONDS
        self.messages.append(Message(text, is_error, until))

    def dismiss_error(self) -> bool:
        """Take the error away that is shown; False: there is none."""
        others = [message for message in self.messages if not message.is_error]
        dismissed = len(others) < len(self.messages)
        self.messages = others
        return dismissed

    def drop_old_messages(self, now: float) -> None:
        """Forget the messages whose time has passed."""
        self.messages = [message for message in self.messages if message.until > now]

    def next_expiry(self) -> float | None:
        """Return when the next message has to go, None: there is none."""
        return min((message.until for message in self.messages), default=None)
