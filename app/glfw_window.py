"""moderngl-window's GLFW window, with what a viewer of still pictures needs besides.

It waits for events instead of asking for them sixty times a second, reports files dropped on it and the need to
repaint, keeps the fractions of the cursor's position, and names keys by what the user's keyboard layout prints on them.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Callable
from typing import Any

# imgui-bundle brings a GLFW of its own and has to point the module `glfw` at it before that is imported: two copies
# of the library in one process know nothing of each other's windows.
import imgui_bundle  # noqa: F401  isort: skip
import glfw
from moderngl_window.context.glfw.window import Window as ModernglGlfwWindow

from app.errors import EXIT_ERROR, WindowError


def start_glfw() -> None:
    """Connect to the display; raises WindowError where there is none."""
    # The windows of an X server are drawn with X; without this, GLFW's Python module may look for Wayland.
    os.environ.setdefault("PYGLFW_LIBRARY_VARIANT", "x11")
    glfw.ERROR_REPORTING = "ignore"
    if not glfw.init():
        raise WindowError(f"no display: {_last_error()}")
    _outlive_x_errors()


# Kept as long as the process lives: Xlib has only their addresses.
_x_handlers: list[object] = []


def _outlive_x_errors() -> None:
    """Replace what Xlib does about errors by default: write several lines and end the process with status 1."""
    if not sys.platform.startswith("linux") or glfw.get_platform() != glfw.PLATFORM_X11:
        return
    xlib = ctypes.CDLL("libX11.so.6")
    refused = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(_request_was_refused)
    gone = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p)(_display_is_gone)
    _x_handlers.extend((refused, gone))
    xlib.XSetErrorHandler(refused)
    xlib.XSetIOErrorHandler(gone)


def _request_was_refused(_display: int, _error: int) -> int:
    # One request of many, such as an answer to a program that has ended while it dropped a file here.
    return 0


def _display_is_gone(_display: int) -> int:
    # The server has ended, and whoever returns from here is ended by Xlib. Nothing can be tidied up through it, and a
    # thread at work must not hold up the end.
    os.write(2, b"surfelscope: the display has gone\n")
    os._exit(EXIT_ERROR)


def wake() -> None:
    """Let the window's loop look whether there is something to do; may be called from any thread."""
    glfw.post_empty_event()


class GlfwWindow(ModernglGlfwWindow):
    """A window; `start_glfw` comes first.

    on_repaint : called when the system has lost what the window showed
    key_name : moderngl-window's name of the key that was pressed or released last, "" if it has none
    """

    def __init__(self, **kwargs: Any) -> None:
        self.on_repaint: Callable[[], None] = lambda: None
        self.key_name = ""
        self._cursor_at = (0.0, 0.0)
        try:
            super().__init__(**kwargs)
        except Exception as error:
            # moderngl-window goes on without a window and stumbles over that; GLFW knows why there is none.
            raise WindowError(f"no OpenGL 3.3 window: {_last_error() or error}") from error
        self._cursor_at = glfw.get_cursor_pos(self._window)
        # On a screen of high density the window has become larger than was asked for.
        self._width, self._height = glfw.get_window_size(self._window)
        # Escape cancels and closes what is open in the window, not the window.
        self.exit_key = None
        # The stubs of GLFW's module say `str` for the paths; it is a list of them.
        on_drop: Any = self._dropped
        glfw.set_drop_callback(self._window, on_drop)
        glfw.set_window_refresh_callback(self._window, self._refreshed)
        glfw.set_framebuffer_size_callback(self._window, self._refreshed)

    @property
    def handle(self) -> Any:
        """GLFW's own window."""
        return self._window

    @property
    def cursor_position(self) -> tuple[float, float]:
        """Where the cursor was at the event that is being handled, in window coordinates from the top left corner.

        GLFW would tell where it is by now; after a slow frame that is somewhere else.
        """
        return self._cursor_at

    @property
    def interface_scale(self) -> float:
        """How much larger than usual letters have to be, in window coordinates."""
        scale = float(glfw.get_window_content_scale(self._window)[0])
        # Where window coordinates are not pixels (macOS), the system scales by itself.
        return max(scale / max(self.pixel_ratio, 1e-6), 0.5)

    def show_frame(self) -> None:
        """Show what was drawn, without asking for events."""
        glfw.swap_buffers(self._window)
        self._frames += 1

    def wait_for_events(self, seconds: float) -> None:
        """Handle what has happened; wait for something to happen, but no longer than `seconds`."""
        if seconds > 0.0:
            glfw.wait_events_timeout(seconds)
        else:
            glfw.poll_events()

    def glfw_key_event_callback(self, window: Any, key: int, scancode: int, action: int, mods: int) -> None:
        """Note the name of the key, then do as moderngl-window does."""
        self.key_name = self._name_of_key(key, scancode)
        super().glfw_key_event_callback(window, key, scancode, action, mods)
        # A Mac's command key stands for control.
        self._modifiers.ctrl = bool(mods & (glfw.MOD_CONTROL | glfw.MOD_SUPER))

    def glfw_mouse_event_callback(self, window: Any, xpos: float, ypos: float) -> None:
        """Report the cursor with its fractions, which moderngl-window drops."""
        dx, dy = xpos - self._cursor_at[0], ypos - self._cursor_at[1]
        self._cursor_at = xpos, ypos
        # The declared types are whole numbers.
        report: Any = self._mouse_drag_event_func if self.mouse_states.any else self._mouse_position_event_func
        report(xpos, ypos, dx, dy)

    def glfw_mouse_button_callback(self, window: Any, button: int, action: int, mods: int) -> None:
        """Report a press or release where it happened."""
        self._handle_modifiers(mods)
        number = self._mouse_button_map.get(button)
        if number is None:
            return
        pressed = action == glfw.PRESS
        self._handle_mouse_button_state_change(number, pressed)
        report: Any = self._mouse_press_event_func if pressed else self._mouse_release_event_func
        report(*self._cursor_at, number)

    def glfw_cursor_enter(self, window: Any, enter: int) -> None:
        """Note where the cursor comes in."""
        if enter:
            self._cursor_at = glfw.get_cursor_pos(self._window)

    def _name_of_key(self, key: int, scancode: int) -> str:
        """Return moderngl-window's name of a key; a letter goes by the layout, not by its place on a US keyboard."""
        printed = glfw.get_key_name(key, scancode)
        if printed and len(printed) == 1 and printed.isascii() and printed.isalpha():
            return str(printed).upper()
        return _KEY_NAMES.get(key, "")

    def _dropped(self, _window: Any, paths: Any) -> None:
        x, y = glfw.get_cursor_pos(self._window)
        self._files_dropped_event_func(int(x), int(y), list(paths))

    def _refreshed(self, *_: Any) -> None:
        self.on_repaint()


_KEY_NAMES = {
    getattr(ModernglGlfwWindow.keys, name): name
    for name in dir(ModernglGlfwWindow.keys)
    if name.isupper() and not name.startswith("ACTION") and isinstance(getattr(ModernglGlfwWindow.keys, name), int)
}


def _last_error() -> str:
    # The stubs of GLFW's module say `str`; it is bytes.
    error: Any = glfw.get_error()
    code, description = error
    return " ".join(description.decode(errors="replace").split()) if code else ""
