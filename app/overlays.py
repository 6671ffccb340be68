"""What lies over the picture: the progress of the work, messages, the help, and a hint where there is no model."""

from __future__ import annotations

from imgui_bundle import ImVec2, imgui

from app.commands import BINDINGS, MOUSE
from app.state import Message
from app.theme import ACCENT_BRIGHT, DIM, ERROR, as_vec4

_FLOATING = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_collapse
    | imgui.WindowFlags_.no_saved_settings
    | imgui.WindowFlags_.always_auto_resize
    | imgui.WindowFlags_.no_focus_on_appearing
    | imgui.WindowFlags_.no_nav
)

Size = tuple[float, float]


def draw_progress(stage: str, fraction: float, area: Size, scale: float) -> bool:
    """Show how far the work is, in the lower middle of the picture; return whether it shall be cancelled."""
    imgui.set_next_window_pos(ImVec2(0.5 * area[0], area[1] - 28.0 * scale), imgui.Cond_.always, ImVec2(0.5, 1.0))
    imgui.begin("progress", None, _FLOATING)
    imgui.text(f"{stage[:1].upper()}{stage[1:]}...")
    imgui.progress_bar(fraction, ImVec2(300.0 * scale, 0.0), "")
    imgui.same_line()
    cancel = imgui.button("Cancel")
    imgui.end()
    return cancel


def draw_messages(messages: list[Message], area: Size, scale: float) -> Message | None:
    """Show the messages in the upper left corner; return one that was clicked away."""
    dismissed = None
    y = 16.0 * scale
    for index, message in enumerate(messages):
        imgui.set_next_window_pos(ImVec2(16.0 * scale, y))
        imgui.begin(f"message {index}", None, _FLOATING)
        if message.is_error:
            imgui.text_colored(as_vec4(ERROR), "Error")
        imgui.push_text_wrap_pos(min(520.0 * scale, max(area[0] - 64.0 * scale, 100.0 * scale)))
        imgui.text_unformatted(message.text)
        imgui.pop_text_wrap_pos()
        if imgui.is_window_hovered() and imgui.is_mouse_clicked(imgui.MouseButton_.left):
            dismissed = message
        y += imgui.get_window_height() + 8.0 * scale
        imgui.end()
    return dismissed


def draw_help(bold: imgui.ImFont, area: Size) -> None:
    """Show what mouse and keys do, in the middle of the picture."""
    imgui.set_next_window_pos(ImVec2(0.5 * area[0], 0.5 * area[1]), imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.begin("help", None, _FLOATING)
    width = max(imgui.calc_text_size(name).x for name, _ in MOUSE) + 2.0 * imgui.get_style().item_spacing.x
    keys = tuple((binding.shown, binding.meaning) for binding in BINDINGS)
    for title, rows in (("Mouse", MOUSE), ("Keys", keys)):
        if rows is keys:
            imgui.spacing()
        imgui.push_font(bold, 0.0)
        imgui.text_colored(as_vec4(ACCENT_BRIGHT), title)
        imgui.pop_font()
        if imgui.begin_table(title, 2, imgui.TableFlags_.sizing_fixed_fit):
            # Both tables have the column of the widest name.
            imgui.table_setup_column("name", imgui.TableColumnFlags_.width_fixed, width)
            for keys_shown, meaning in rows:
                imgui.table_next_column()
                imgui.text(keys_shown)
                imgui.table_next_column()
                imgui.text_colored(as_vec4(DIM), meaning)
            imgui.end_table()
    imgui.end()


def draw_hint(area: Size) -> None:
    """Say what to do where no model is open."""
    imgui.set_next_window_pos(ImVec2(0.5 * area[0], 0.5 * area[1]), imgui.Cond_.always, ImVec2(0.5, 0.5))
    imgui.begin("hint", None, _FLOATING | imgui.WindowFlags_.no_background | imgui.WindowFlags_.no_inputs)
    imgui.text_colored(as_vec4(DIM), "Drop a model here, or press Ctrl+O")
    imgui.end()
