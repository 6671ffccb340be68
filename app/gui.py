"""Dear ImGui in the window: its context, letters and style, its input and its drawing."""

from __future__ import annotations

from collections.abc import Callable

import glfw
from imgui_bundle import imgui
from imgui_bundle.python_backends.glfw_backend import GlfwRenderer
from OpenGL import GL
from OpenGL.error import GLError

from app.errors import GraphicsError
from app.glfw_window import GlfwWindow
from app.theme import apply_theme, load_fonts

# A window that has waited for a minute must not tell ImGui that a minute has passed in one frame.
LONGEST_STEP = 0.1


class Gui:
    """Feeds ImGui with events and draws what is described in a frame.

    bold : letters for headings
    """

    def __init__(self, window: GlfwWindow) -> None:
        self._window = window
        self._context = imgui.create_context()
        io = imgui.get_io()
        # Nothing is written into the folder that the program happens to be started in.
        io.set_ini_filename("")
        self.bold = load_fonts()
        self._scale = 0.0
        # moderngl-window owns the callbacks; the events come through it.
        self._backend = GlfwRenderer(window.handle, attach_callbacks=False)

    @property
    def wants_mouse(self) -> bool:
        """The cursor is over something of ImGui's, or holds it."""
        return bool(imgui.get_io().want_capture_mouse)

    @property
    def wants_keyboard(self) -> bool:
        """The user is typing into a field."""
        return bool(imgui.get_io().want_text_input)

    @property
    def has_pending_input(self) -> bool:
        """Some events wait for the next frame: ImGui takes a quick press and its release one after the other."""
        return bool(self._context.input_events_queue.size())

    def draw(self, describe: Callable[[float], None]) -> None:
        """Draw one frame onto the bound framebuffer; `describe` is called with the interface's scale.

        Raises GraphicsError where OpenGL fails.
        """
        scale = self._window.interface_scale
        if scale != self._scale:
            self._scale = scale
            apply_theme(scale)
        self._backend.process_inputs()
        io = imgui.get_io()
        io.delta_time = min(io.delta_time, LONGEST_STEP)
        imgui.new_frame()
        describe(scale)
        imgui.render()
        # The backend leaves the program in use that it found; one that has been released since cannot be used again.
        try:
            GL.glUseProgram(0)
            self._backend.render(imgui.get_draw_data())
        except GLError as error:
            raise GraphicsError(f"OpenGL: error {error.err} in the panel") from error

    def move_mouse(self, x: float, y: float) -> None:
        """Report the cursor, in window coordinates."""
        imgui.get_io().add_mouse_pos_event(x, y)

    def press_mouse(self, button: int, down: bool) -> None:
        """Report a button: 0 left, 1 right, 2 middle."""
        self.move_mouse(*self._window.cursor_position)
        imgui.get_io().add_mouse_button_event(button, down)

    def turn_wheel(self, dx: float, dy: float) -> None:
        """Report the wheel, in notches."""
        imgui.get_io().add_mouse_wheel_event(dx, dy)

    def press_key(self, key: int, action: int) -> None:
        """Report a key of GLFW's."""
        self._backend.keyboard_callback(self._window.handle, key, 0, action, 0)

    def type_character(self, character: str) -> None:
        """Report a typed character."""
        self._backend.char_callback(self._window.handle, ord(character))

    def release_keys(self) -> None:
        """Forget keys that are held: the window has lost the focus, and will not hear of their release."""
        imgui.get_io().add_focus_event(bool(glfw.get_window_attrib(self._window.handle, glfw.FOCUSED)))

    def close(self) -> None:
        """Give back what is held on the GPU."""
        self._backend.shutdown()
        imgui.destroy_context(self._context)
