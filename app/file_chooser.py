"""Choosing a file: the system's own dialog, or a field to type a path into where there is none."""

from __future__ import annotations

import shutil
import sys
from pathlib import Path

from imgui_bundle import ImVec2, imgui, portable_file_dialogs

# Any of these programs gives Linux a dialog.
_LINUX_DIALOGS = ("zenity", "kdialog", "matedialog", "qarma")

_TITLE = "Open a model"
_FILTERS = [
    "Models",
    "*.ply *.obj *.stl *.off *.glb *.gltf *.3mf *.dae *.las *.laz *.e57 *.xyz *.pts *.txt *.asc *.csv",
    "All files",
    "*",
]


def has_native_dialog() -> bool:
    """Tell whether the system has a file dialog that can be opened from here."""
    return not sys.platform.startswith("linux") or any(shutil.which(program) for program in _LINUX_DIALOGS)


class FileChooser:
    """Asks for one file at a time; the window goes on while it does."""

    def __init__(self) -> None:
        self._dialog: portable_file_dialogs.open_file | None = None
        self._typed: str | None = None
        self._appearing = False

    @property
    def waiting(self) -> bool:
        """A dialog of the system's is open; it has to be polled."""
        return self._dialog is not None

    def ask(self, folder: Path) -> None:
        """Begin to ask, starting in a folder."""
        if self._dialog is not None or self._typed is not None:
            return
        if has_native_dialog():
            self._dialog = portable_file_dialogs.open_file(_TITLE, str(folder), _FILTERS)
        else:
            self._typed, self._appearing = "", True

    def poll(self) -> Path | None:
        """Return what the user chose in the system's dialog, once."""
        if self._dialog is None or not self._dialog.ready(0):
            return None
        chosen, self._dialog = self._dialog.result(), None
        return Path(chosen[0]) if chosen else None

    def draw(self, scale: float) -> Path | None:
        """Show the field to type into, where there is no dialog; return the path once it is entered."""
        if self._typed is None:
            return None
        if self._appearing:
            imgui.open_popup(_TITLE)
        middle = imgui.get_main_viewport().get_center()
        imgui.set_next_window_pos(middle, imgui.Cond_.appearing, ImVec2(0.5, 0.5))
        if not imgui.begin_popup_modal(_TITLE, None, imgui.WindowFlags_.always_auto_resize)[0]:
            self._typed = None
            return None
        if self._appearing:
            imgui.set_keyboard_focus_here()
            self._appearing = False
        imgui.set_next_item_width(460.0 * scale)
        entered, self._typed = imgui.input_text_with_hint(
            "##path", "Path of a model", self._typed, imgui.InputTextFlags_.enter_returns_true
        )
        entered |= imgui.button("Open")
        imgui.same_line()
        cancelled = imgui.button("Cancel") or imgui.is_key_pressed(imgui.Key.escape)
        path = Path(self._typed.strip()).expanduser() if entered and self._typed.strip() else None
        if path or cancelled:
            self._typed = None
            imgui.close_current_popup()
        imgui.end_popup()
        return path
