"""How the panel looks: colours, spacing and letters. The one place where they are chosen."""

from __future__ import annotations

from pathlib import Path

import imgui_bundle
from imgui_bundle import ImVec2, ImVec4, imgui

FONT_SIZE = 15.0

Color = tuple[float, float, float, float]


def _rgb(code: int, alpha: float = 1.0) -> Color:
    return ((code >> 16) / 255.0, (code >> 8 & 255) / 255.0, (code & 255) / 255.0, alpha)


PANEL = _rgb(0x16181C, 0.97)
RAISED = _rgb(0x24272E)
HOVERED = _rgb(0x30343D)
PRESSED = _rgb(0x3A404B)
BORDER = _rgb(0x2D3139)
TEXT = _rgb(0xE4E7EC)
DIM = _rgb(0x8D95A3)
ACCENT = _rgb(0x4FB3BF)
ACCENT_BRIGHT = _rgb(0x7FD3DC)
ERROR = _rgb(0xE06C62)

# One for each stage of a frame, told apart without red and green.
STAGE_COLORS = (_rgb(0xE8B45A), _rgb(0x5B8DEF), _rgb(0x4FB3BF), _rgb(0xB07CD8))


def as_vec4(color: Color) -> ImVec4:
    """Return a colour as ImGui's style wants it."""
    return ImVec4(*color)


def as_u32(color: Color) -> int:
    """Return a colour as ImGui's draw lists want it."""
    return imgui.color_convert_float4_to_u32(ImVec4(*color))


def load_fonts() -> imgui.ImFont:
    """Load the regular letters as the default, and return the bold ones."""
    folder = Path(imgui_bundle.__file__).parent / "assets" / "fonts" / "Roboto"
    fonts = imgui.get_io().fonts
    fonts.add_font_from_file_ttf(str(folder / "Roboto-Regular.ttf"), FONT_SIZE)
    return fonts.add_font_from_file_ttf(str(folder / "Roboto-Bold.ttf"), FONT_SIZE)


def apply_theme(scale: float) -> None:
    """Set the style; `scale` enlarges it on screens of high density."""
    imgui.style_colors_dark()
    style = imgui.get_style()
    style.window_padding = ImVec2(16.0, 12.0)
    style.frame_padding = ImVec2(8.0, 3.5)
    style.item_spacing = ImVec2(8.0, 5.0)
    style.item_inner_spacing = ImVec2(8.0, 4.0)
    style.window_rounding = 8.0
    style.frame_rounding = 5.0
    style.grab_rounding = 4.0
    style.popup_rounding = 6.0
    style.scrollbar_rounding = 6.0
    style.scrollbar_size = 10.0
    style.grab_min_size = 11.0
    style.window_border_size = 0.0
    style.frame_border_size = 0.0
    style.popup_border_size = 1.0
    style.scale_all_sizes(scale)
    style.font_scale_main = scale
    for item, color in _COLORS.items():
        style.set_color_(item, as_vec4(color))


_COLORS = {
    imgui.Col_.text: TEXT,
    imgui.Col_.text_disabled: DIM,
    imgui.Col_.window_bg: PANEL,
    imgui.Col_.popup_bg: _rgb(0x1C1F24, 0.99),
    imgui.Col_.border: BORDER,
    imgui.Col_.frame_bg: RAISED,
    imgui.Col_.frame_bg_hovered: HOVERED,
    imgui.Col_.frame_bg_active: PRESSED,
    imgui.Col_.title_bg: PANEL,
    imgui.Col_.title_bg_active: PANEL,
    imgui.Col_.scrollbar_bg: _rgb(0, 0.0),
    imgui.Col_.scrollbar_grab: HOVERED,
    imgui.Col_.scrollbar_grab_hovered: PRESSED,
    imgui.Col_.scrollbar_grab_active: PRESSED,
    imgui.Col_.check_mark: ACCENT_BRIGHT,
    imgui.Col_.slider_grab: ACCENT,
    imgui.Col_.slider_grab_active: ACCENT_BRIGHT,
    imgui.Col_.button: RAISED,
    imgui.Col_.button_hovered: HOVERED,
    imgui.Col_.button_active: PRESSED,
    imgui.Col_.header: RAISED,
    imgui.Col_.header_hovered: HOVERED,
    imgui.Col_.header_active: PRESSED,
    imgui.Col_.separator: BORDER,
    imgui.Col_.plot_histogram: ACCENT,
    imgui.Col_.nav_cursor: ACCENT,
    imgui.Col_.text_selected_bg: _rgb(0x4FB3BF, 0.35),
    imgui.Col_.modal_window_dim_bg: _rgb(0, 0.55),
}
