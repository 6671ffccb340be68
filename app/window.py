"""The window: hands events to the camera, the panel and the commands, and draws when something has changed."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from datetime import datetime
from pathlib import Path
from typing import Any

import moderngl
from moderngl_window import activate_context
from moderngl_window.context.base import WindowConfig
from moderngl_window.timers.clock import Timer

from app import overlays, panel
from app.cache_command import user_cache
from app.commands import Command, find_command
from app.errors import GraphicsError, OutputError, graphics_errors
from app.file_chooser import FileChooser
from app.gestures import Button, Gestures
from app.glfw_window import GlfwWindow, wake
from app.gui import Gui
from app.options import Options
from app.scene import Scene
from app.screenshot import save_screenshot
from app.state import FrameReport
from app.viewer import AXIS_VIEWS, Viewer
from app.viewport import Viewport

DEFAULT_SIZE = (1280, 800)
EMPTY_COLOR = (0.10, 0.11, 0.13)

# ImGui needs a frame to hear of an event, one to answer and one to settle.
SETTLING_FRAMES = 3
# How long the loop sleeps at most when nothing happens: Python sees an interrupt only when it wakes up.
LONGEST_SLEEP = 0.25
# While something works in the background its progress is drawn this often (seconds).
PROGRESS_INTERVAL = 0.05

_BUTTONS = {1: (Button.LEFT, 0), 2: (Button.RIGHT, 1), 3: (Button.MIDDLE, 2)}


class ViewerWindow(WindowConfig):
    """Everything that needs the window: input, drawing, and the loop that waits for both."""

    gl_version = (3, 3)
    title = "Surfelscope"

    def __init__(self, options: Options, ctx: moderngl.Context, wnd: GlfwWindow) -> None:
        # The callbacks are set by the base class and need what follows.
        super().__init__(ctx=ctx, wnd=wnd, timer=Timer())
        self._window = wnd
        self._verbose = options.verbose
        self._gui = Gui(wnd)
        cache = user_cache(options, self._say)
        self._viewport = Viewport(ctx, wake, options.tile_bytes, cache)
        self._viewer = Viewer(options, wake, self._viewport.upload, cache)
        self._gestures = Gestures(self._viewport.depth_at)
        self._chooser = FileChooser()
        self._unsettled = SETTLING_FRAMES
        self._shown: tuple[object, ...] = ()
        self._iconified = self._idle = False
        wnd.on_repaint = self._stir
        self._actions = self._make_actions()

    # The loop.

    def show(self) -> None:
        """Show the window until it is closed; raises GraphicsError where OpenGL fails for good."""
        with graphics_errors():
            while not self._window.is_closing:
                self._report_idleness()
                self._window.wait_for_events(self._sleep())
                self._step()
            self._viewport.release()
            self._gui.close()

    def close(self) -> bool:
        """Stop the work in the background; False: it does not end at once."""
        return self._viewer.close()

    @property
    def _has_to_draw(self) -> bool:
        return self._unsettled > 0 or self._viewer.state.continuous or self._viewport.is_stale(self._viewer)

    @property
    def _waits_for_work(self) -> bool:
        has_scene = self._viewer.scene is not None
        return self._viewer.task is not None or self._chooser.waiting or (has_scene and self._viewport.is_baking)

    def _sleep(self) -> float:
        """Return how long the loop may wait for an event."""
        if self._iconified:
            return LONGEST_SLEEP
        if self._has_to_draw:
            return 0.0
        if self._waits_for_work:
            return PROGRESS_INTERVAL
        times = (self._viewer.state.next_expiry(), self._viewer.steering.next_change)
        sleeps = [max(moment - time.monotonic(), 0.001) for moment in times if moment is not None]
        return min([*sleeps, LONGEST_SLEEP])

    def _step(self) -> None:
        """Take over finished work and draw what has changed: the model, or only what lies around it."""
        viewer, state = self._viewer, self._viewer.state
        self._viewport.size = self._picture_size()
        viewer.poll(self._viewport.size)
        chosen = self._chooser.poll()
        if chosen is not None:
            viewer.open_path(chosen)
        state.drop_old_messages(time.monotonic())
        shown = (viewer.task, tuple(state.messages))
        if shown != self._shown:
            # ImGui hides what is new for a frame, to measure it.
            self._shown, self._unsettled = shown, SETTLING_FRAMES
        elif viewer.task is not None:
            self._unsettled = max(self._unsettled, 1)
        if self._iconified:
            return
        if state.continuous or self._viewport.is_stale(viewer):
            if viewer.scene is not None:
                self._draw_picture(viewer.scene)
            self._unsettled = max(self._unsettled, 1)
        if self._unsettled > 0:
            self._draw_window()
            self._unsettled = max(self._unsettled - 1, 1 if self._gui.has_pending_input else 0)

    def _draw_picture(self, scene: Scene) -> None:
        """Draw the model; where that cannot be done the last picture stays and a message says why."""
        try:
            report = self._viewport.draw(self._viewer)
        except GraphicsError as error:
            self._viewer.state.say(str(error), is_error=True)
        except MemoryError:
            self._viewer.state.say("There is not enough memory for this picture", is_error=True)
        else:
            self._report(report)
            shortcoming = self._viewport.shortcoming(scene)
            if shortcoming:
                self._viewer.state.say(shortcoming)

    def _draw_window(self) -> None:
        screen = self.ctx.screen
        screen.use()
        screen.viewport = (0, 0, *self._window.buffer_size)
        screen.clear(*EMPTY_COLOR)
        if self._viewer.scene is not None:
            self._viewport.show(screen)
        screen.use()
        self._gui.draw(self._describe)
        self._window.show_frame()

    def _report_idleness(self) -> None:
        """Say, to the curious, when there is nothing left to do."""
        idle = not self._has_to_draw and not self._waits_for_work and self._viewer.steering.next_change is None
        if idle and not self._idle:
            self._say("idle")
        self._idle = idle

    def _report(self, report: FrameReport) -> None:
        self._viewer.drawn(report)
        unkept = self._viewport.take_unkept()
        if unkept is not None:
            self._viewer.keep_tiles(unkept)
        self._say(
            f"frame: {report.splats} splats, {report.triangles} triangles, {report.silhouette} silhouette, "
            f"{report.total:.2f} ms"
        )

    def _say(self, what: str) -> None:
        """Say something to the curious, from any thread."""
        if self._verbose:
            # In one piece: what another thread says must not come between a line and its end.
            sys.stderr.write(f"{what}\n")
            sys.stderr.flush()

    def _describe(self, scale: float) -> None:
        """Describe panel and overlays to ImGui, and do what they ask for."""
        viewer, state = self._viewer, self._viewer.state
        commands = []
        if state.show_panel:
            commands = panel.draw_panel(state, viewer.scene, self._viewport.gpu_bytes, self._gui.bold, scale)
        ratio = self._window.pixel_ratio
        area = (self._viewport.size[0] / ratio, self._viewport.size[1] / ratio)
        if viewer.task is not None:
            if overlays.draw_progress(*viewer.task.progress, area, scale):
                viewer.cancel()
        elif viewer.scene is None:
            overlays.draw_hint(area)
        dismissed = overlays.draw_messages(state.messages, area, scale)
        if dismissed in state.messages:
            state.messages.remove(dismissed)
        if state.show_help:
            overlays.draw_help(self._gui.bold, area)
        path = self._chooser.draw(scale)
        if path is not None:
            viewer.open_path(path)
        for command in commands:
            self._actions[command]()

    # Commands.

    def _make_actions(self) -> dict[Command, Callable[[], None]]:
        viewer = self._viewer
        actions: dict[Command, Callable[[], None]] = {
            Command.OPEN: lambda: self._chooser.ask(Path.cwd()),
            Command.FIT: lambda: viewer.fit(self._viewport.size),
            Command.ORTHOGRAPHIC: viewer.flip_projection,
            Command.SCREENSHOT: self._screenshot,
            Command.NORMAL_MAPPING: lambda: self._flip("normal_mapping"),
            Command.SILHOUETTE: lambda: self._flip("silhouette_overlay"),
            Command.OUTLINES: lambda: self._flip("splat_outlines"),
            Command.LEVELS: lambda: self._flip("lod_colors"),
            Command.PANEL: self._toggle_panel,
            Command.HELP: self._toggle_help,
            Command.DISMISS: self._dismiss,
            Command.QUIT: self._window.close,
        }
        for command in AXIS_VIEWS:
            actions[command] = lambda command=command: viewer.look_along_axis(command)  # type: ignore[misc]
        return actions

    def _flip(self, field: str) -> None:
        settings = self._viewer.state.settings
        flipped: dict[str, Any] = {field: not getattr(settings, field)}
        self._viewer.state.settings = replace(settings, **flipped)

    def _toggle_panel(self) -> None:
        self._viewer.state.show_panel = not self._viewer.state.show_panel

    def _toggle_help(self) -> None:
        self._viewer.state.show_help = not self._viewer.state.show_help

    def _dismiss(self) -> None:
        state = self._viewer.state
        if state.show_help:
            state.show_help = False
        elif not self._viewer.cancel():
            state.dismiss_error()

    def _screenshot(self) -> None:
        try:
            picture = self._viewport.picture() if self._viewer.scene is not None else None
            if picture is None:
                return
            self._viewer.state.say(f"Saved {save_screenshot(picture, datetime.now())}")
        except OutputError as error:
            self._viewer.state.say(str(error), is_error=True)
        except MemoryError:
            self._viewer.state.say("There is not enough memory for a screenshot", is_error=True)

    # Events.

    def on_key_event(self, key: Any, action: Any, modifiers: Any) -> None:
        """Hand a key to ImGui, and obey it unless the user is typing."""
        self._stir()
        self._gui.press_key(key, action)
        if action != self._window.keys.ACTION_PRESS or self._gui.wants_keyboard:
            return
        command = find_command(self._window.key_name, bool(modifiers.ctrl))
        if command is not None:
            self._actions[command]()

    def on_unicode_char_entered(self, char: str) -> None:
        """Hand a typed character to ImGui."""
        self._stir()
        self._gui.type_character(char)

    def on_mouse_position_event(self, x: float, y: float, dx: float, dy: float) -> None:
        """Let the panel know where the cursor is."""
        self._stir()
        self._gui.move_mouse(x, y)

    def on_mouse_drag_event(self, x: float, y: float, dx: float, dy: float) -> None:
        """Turn or shift the camera, if the drag began over the picture."""
        self._stir()
        self._gui.move_mouse(x, y)
        viewer, ratio = self._viewer, self._window.pixel_ratio
        if viewer.camera is not None:
            viewer.camera = self._gestures.drag(viewer.camera, dx * ratio, dy * ratio, self._viewport.size)

    def on_mouse_press_event(self, x: float, y: float, button: int) -> None:
        """Begin a drag where the picture is, or hand the press to the panel."""
        self._stir()
        gesture_button, gui_button = _BUTTONS[button]
        self._gui.press_mouse(gui_button, True)
        viewer = self._viewer
        if viewer.camera is None or not self._over_picture(x, y):
            return
        viewer.camera = self._gestures.press(
            viewer.camera,
            gesture_button,
            self._pixel(x, y),
            shift=bool(self._window.modifiers.shift),
            now=time.monotonic(),
            size=self._viewport.size,
        )

    def on_mouse_release_event(self, x: float, y: float, button: int) -> None:
        """End a drag."""
        self._stir()
        gesture_button, gui_button = _BUTTONS[button]
        self._gui.press_mouse(gui_button, False)
        self._gestures.release(gesture_button)

    def on_mouse_scroll_event(self, x_offset: float, y_offset: float) -> None:
        """Zoom towards the cursor, or scroll the panel."""
        self._stir()
        x, y = self._window.cursor_position
        viewer = self._viewer
        if viewer.camera is None or viewer.scene is None or not self._over_picture(x, y):
            self._gui.turn_wheel(x_offset, y_offset)
            return
        radius = viewer.scene.hierarchy.scale * viewer.scene.hierarchy.radius
        viewer.camera = self._gestures.wheel(
            viewer.camera, y_offset, self._pixel(x, y), radius=radius, size=self._viewport.size
        )

    def on_files_dropped_event(self, x: int, y: int, paths: list[Any]) -> None:
        """Open the first of the files dropped on the window."""
        self._stir()
        if paths:
            self._viewer.open_path(Path(paths[0]))

    def on_resize(self, width: int, height: int) -> None:
        """Draw the picture in its new size."""
        self._stir()

    def on_iconify(self, iconified: bool) -> None:
        """Draw nothing while nobody can see it."""
        self._iconified = iconified
        self._stir()

    def _stir(self) -> None:
        """Draw the window again soon: something has happened that may show in it."""
        self._unsettled = SETTLING_FRAMES

    def _over_picture(self, x: float, y: float) -> bool:
        """Tell whether window coordinates lie over the picture, with nothing of the panel's on top."""
        column, row = self._pixel(x, y)
        width, height = self._viewport.size
        return 0 <= column < width and 0 <= row < height and not self._gui.wants_mouse

    def _pixel(self, x: float, y: float) -> tuple[float, float]:
        ratio = self._window.pixel_ratio
        return x * ratio, y * ratio

    def _picture_size(self) -> tuple[int, int]:
        width, height = self._window.buffer_size
        if self._viewer.state.show_panel:
            width -= round(panel.WIDTH * self._window.interface_scale * self._window.pixel_ratio)
        return max(width, 1), max(height, 1)


def open_window(options: Options) -> bool:
    """Open the window and return once it is closed; `start_glfw` comes first.

    Returns False where work in the background does not end at once. Raises WindowError, or GraphicsError where OpenGL
    fails for good.
    """
    window = GlfwWindow(
        title=ViewerWindow.title,
        size=options.resolution or DEFAULT_SIZE,
        gl_version=ViewerWindow.gl_version,
        resizable=True,
        visible=True,
        vsync=True,
        samples=0,
    )
    try:
        activate_context(window=window)
        viewer = ViewerWindow(options, window.ctx, window)
        viewer.show()
    finally:
        # It shall not stand there while the work ends.
        window.destroy()
    return viewer.close()
