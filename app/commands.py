"""What keys do: one table that is obeyed and shown as the help."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto


class Command(Enum):
    """Something that a key can ask for."""

    OPEN = auto()
    FIT = auto()
    FRONT = auto()
    BACK = auto()
    RIGHT = auto()
    LEFT = auto()
    TOP = auto()
    BOTTOM = auto()
    ORTHOGRAPHIC = auto()
    SCREENSHOT = auto()
    NORMAL_MAPPING = auto()
    SILHOUETTE = auto()
    OUTLINES = auto()
    LEVELS = auto()
    PANEL = auto()
    HELP = auto()
    DISMISS = auto()
    QUIT = auto()


@dataclass(frozen=True)
class Binding:
    """Keys, by their names in moderngl-window, that mean a command; `ctrl` (or command, on a Mac) has to be held."""

    keys: tuple[str, ...]
    command: Command
    shown: str
    meaning: str
    ctrl: bool = False


BINDINGS = (
    Binding(("O",), Command.OPEN, "Ctrl+O", "open a model", ctrl=True),
    Binding(("HOME", "R"), Command.FIT, "Home, R", "fit the model into the window"),
    Binding(("NUMBER_1", "NUMPAD_1"), Command.FRONT, "1", "look from the front"),
    Binding(("NUMBER_3", "NUMPAD_3"), Command.RIGHT, "3", "look from the right"),
    Binding(("NUMBER_7", "NUMPAD_7"), Command.TOP, "7", "look from above"),
    Binding(("NUMBER_1", "NUMPAD_1"), Command.BACK, "Ctrl+1", "look from behind", ctrl=True),
    Binding(("NUMBER_3", "NUMPAD_3"), Command.LEFT, "Ctrl+3", "look from the left", ctrl=True),
    Binding(("NUMBER_7", "NUMPAD_7"), Command.BOTTOM, "Ctrl+7", "look from below", ctrl=True),
    Binding(("NUMBER_5", "NUMPAD_5"), Command.ORTHOGRAPHIC, "5", "perspective or orthographic"),
    Binding(("N",), Command.NORMAL_MAPPING, "N", "normal mapping"),
    Binding(("E",), Command.SILHOUETTE, "E", "silhouette surfels tinted"),
    Binding(("B",), Command.OUTLINES, "B", "outlines of the splats"),
    Binding(("L",), Command.LEVELS, "L", "colours by level of detail"),
    Binding(("S", "F12"), Command.SCREENSHOT, "S, F12", "save a screenshot"),
    Binding(("TAB",), Command.PANEL, "Tab", "show or hide the panel"),
    Binding(("H", "F1"), Command.HELP, "H, F1", "show or hide this help"),
    Binding(("ESCAPE",), Command.DISMISS, "Esc", "close this help or an error, cancel the work"),
    Binding(("Q",), Command.QUIT, "Ctrl+Q", "quit", ctrl=True),
)

# What the mouse does; shown with the keys.
MOUSE = (
    ("Left button", "orbit"),
    ("Shift + left, middle", "pan"),
    ("Wheel", "zoom towards the cursor"),
    ("Double click", "turn around this point"),
    ("Drop a file", "open it"),
)


def find_command(key_name: str, ctrl: bool) -> Command | None:
    """Return what a key means, None: nothing."""
    for binding in BINDINGS:
        if binding.ctrl == ctrl and key_name in binding.keys:
            return binding.command
    return None
