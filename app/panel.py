"""The panel beside the picture. It edits the viewer's state and asks for commands; it computes nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from imgui_bundle import ImVec2, ImVec4, imgui

from app.commands import Command
from app.graph import draw_graph
from app.memory import peak_memory_mb
from app.options import TEXELS
from app.scene import Scene
from app.state import ViewerState
from app.theme import ACCENT_BRIGHT, DIM, PANEL, as_vec4
from renderer.settings import MATERIALS, Settings

# In units of the interface's scale.
WIDTH = 316.0
LABEL_WIDTH = 100.0
VALUE_WIDTH = 64.0
SECOND_COLUMN = 200.0

MAX_R_SIL, MAX_R_INNER = 32.0, 64.0

_BUTTONS = (
    ("Open", Command.OPEN, "Open a model (Ctrl+O)"),
    ("Fit", Command.FIT, "Fit the model into the window (Home or R)"),
    ("Save", Command.SCREENSHOT, "Save a screenshot (S or F12)"),
    ("Keys", Command.HELP, "What mouse and keys do (H)"),
)

_FLAGS = (
    imgui.WindowFlags_.no_title_bar
    | imgui.WindowFlags_.no_move
    | imgui.WindowFlags_.no_resize
    | imgui.WindowFlags_.no_collapse
    | imgui.WindowFlags_.no_saved_settings
)


def draw_panel(
    state: ViewerState, scene: Scene | None, gpu_bytes: int, bold: imgui.ImFont, scale: float
) -> list[Command]:
    """Describe the panel for this frame; return the commands that its buttons ask for."""
    display = imgui.get_io().display_size
    imgui.set_next_window_pos(ImVec2(display.x - WIDTH * scale, 0.0))
    imgui.set_next_window_size(ImVec2(WIDTH * scale, display.y))
    imgui.push_style_var(imgui.StyleVar_.window_rounding, 0.0)
    imgui.push_style_color(imgui.Col_.window_bg, ImVec4(*PANEL[:3], 1.0))
    imgui.begin("panel", None, _FLAGS)
    commands = _header(scene, bold, scale)
    _heading("Detail", bold, scale)
    _detail(state, scene, scale)
    _heading("Shading", bold, scale)
    state.settings = _shading(state.settings, scene, scale)
    _heading("Overlays", bold, scale)
    state.settings = _overlays(state.settings)
    _heading("Statistics", bold, scale)
    _statistics(state, scene, gpu_bytes, scale)
    imgui.end()
    imgui.pop_style_color()
    imgui.pop_style_var()
    return commands


def _header(scene: Scene | None, bold: imgui.ImFont, scale: float) -> list[Command]:
    imgui.push_font(bold, 1.25 * imgui.get_style().font_size_base)
    imgui.text(scene.hierarchy.name if scene else "Surfelscope")
    imgui.pop_font()
    if scene is not None:
        _dim(f"{scene.hierarchy.leaf_count:,} {scene.hierarchy.leaf_kind}, {scene.hierarchy.node_count:,} nodes")
    else:
        _dim("no model")
    imgui.dummy(ImVec2(0.0, 1.0 * scale))
    width = (imgui.get_content_region_avail().x - (len(_BUTTONS) - 1) * imgui.get_style().item_spacing.x) / len(
        _BUTTONS
    )
    commands = []
    for index, (label, command, hint) in enumerate(_BUTTONS):
        if index:
            imgui.same_line()
        if imgui.button(label, ImVec2(width, 0.0)):
            commands.append(command)
        _hint(hint)
    return commands


def _detail(state: ViewerState, scene: Scene | None, scale: float) -> None:
    state.r_sil = _slider("r_sil", state.r_sil, MAX_R_SIL, "Largest radius of a surfel on the silhouette", scale)
    state.r_inner = _slider("r_inner", state.r_inner, MAX_R_INNER, "Largest radius of any other surfel", scale)
    _label("w_s", "Texels along one side of a normal tile; a change bakes all tiles anew in the background", scale)
    imgui.set_next_item_width(-VALUE_WIDTH * scale)
    chosen = TEXELS.index(state.texels) if state.texels in TEXELS else 0
    # A slider of whole numbers would have a handle as wide as a step.
    flags = imgui.SliderFlags_.no_input
    changed, place = imgui.slider_float("##w_s", float(chosen), 0.0, len(TEXELS) - 1.0, "", flags)
    if changed:
        state.texels = TEXELS[round(place)]
    _value(f"{state.texels} × {state.texels}" if state.texels else "none")
    if scene is not None and scene.tiles is not None and scene.tiles.texels != state.texels:
        _dim(f"still drawn with {scene.tiles.texels} × {scene.tiles.texels}")


def _shading(settings: Settings, scene: Scene | None, scale: float) -> Settings:
    settings = _toggle(settings, "Normal mapping", "normal_mapping", "N")
    settings = _toggle(settings, "Two-sided lighting", "two_sided")
    imgui.same_line(SECOND_COLUMN * scale)
    settings = _toggle(settings, "Ground", "ground")
    if scene is not None and scene.content.colored:
        settings = _toggle(settings, "The model's colours", "use_colors")
    _label("Material", "Clay is lit by two lights, the others are spheres painted in advance", scale)
    changed, index = imgui.combo("##material", MATERIALS.index(settings.material), [m.capitalize() for m in MATERIALS])
    if changed:
        settings = replace(settings, material=MATERIALS[index])
    for label, top, field in (("Background", True, "background_top"), ("", False, "background_bottom")):
        if top:
            _label(label, "Colours at the top and at the bottom of the picture", scale)
        else:
            imgui.same_line()
        flags = imgui.ColorEditFlags_.no_inputs | imgui.ColorEditFlags_.no_label
        changed, color = imgui.color_edit3(f"##{field}", list(getattr(settings, field)), flags)
        if changed:
            settings = _replace(settings, field, tuple(color))
    return settings


def _overlays(settings: Settings) -> Settings:
    settings = _toggle(settings, "Silhouette surfels", "silhouette_overlay", "E")
    settings = _toggle(settings, "Splat outlines", "splat_outlines", "B")
    return _toggle(settings, "Level-of-detail colours", "lod_colors", "L")


def _statistics(state: ViewerState, scene: Scene | None, gpu_bytes: int, scale: float) -> None:
    draw_graph(state.history, scale)
    if state.history:
        last = state.history[-1]
        _row("Splats", f"{last.splats:,}")
        _row("Leaf triangles", f"{last.triangles:,}")
        _row("On the silhouette", f"{last.silhouette:,}")
        _row("Nodes visited", f"{last.visited:,}")
    if scene is not None:
        tiles = scene.tiles.nbytes if scene.tiles is not None else 0
        _row("Hierarchy, tiles", f"{scene.hierarchy.nbytes / 1e6:,.1f} MB, {tiles / 1e6:,.1f} MB")
    peak = peak_memory_mb()
    _row("GPU, process", f"{gpu_bytes / 1e6:,.1f} MB" + (f", {peak:,.0f} MB" if peak is not None else ""))
    _, state.continuous = imgui.checkbox("Draw continuously", state.continuous)
    _hint("Draws again and again, to measure; otherwise only what changes is drawn")


def _heading(text: str, bold: imgui.ImFont, scale: float) -> None:
    imgui.dummy(ImVec2(0.0, 1.0 * scale))
    imgui.separator()
    imgui.push_font(bold, 0.0)
    imgui.text_colored(as_vec4(ACCENT_BRIGHT), text)
    imgui.pop_font()


def _label(text: str, hint: str, scale: float) -> None:
    """Write a label at the left; what follows fills the rest of the line."""
    imgui.align_text_to_frame_padding()
    imgui.text(text)
    _hint(hint)
    imgui.same_line(LABEL_WIDTH * scale)
    imgui.set_next_item_width(-1.0)


def _slider(label: str, value: float, most: float, hint: str, scale: float) -> float:
    """Return a radius in pixels, from 0 to `most`."""
    _label(label, f"{hint}, in pixels (Ctrl+click to type)", scale)
    imgui.set_next_item_width(-VALUE_WIDTH * scale)
    _, value = imgui.slider_float(f"##{label}", value, 0.0, most, "", imgui.SliderFlags_.always_clamp)
    _value(f"{value:.1f} px")
    return value


def _toggle(settings: Settings, label: str, field: str, key: str = "") -> Settings:
    changed, value = imgui.checkbox(label, bool(getattr(settings, field)))
    if key:
        imgui.push_style_color(imgui.Col_.text, as_vec4(DIM))
        _value(key)
        imgui.pop_style_color()
    return _replace(settings, field, value) if changed else settings


def _replace(settings: Settings, field: str, value: Any) -> Settings:
    return replace(settings, **{field: value})


def _row(label: str, value: str) -> None:
    _dim(label)
    _value(value)


def _value(text: str) -> None:
    """Write a value at the right end of the line."""
    imgui.same_line()
    left = imgui.get_cursor_pos_x() + imgui.get_content_region_avail().x - imgui.calc_text_size(text).x
    imgui.set_cursor_pos_x(left)
    imgui.text(text)


def _dim(text: str) -> None:
    imgui.text_colored(as_vec4(DIM), text)


def _hint(text: str) -> None:
    if imgui.is_item_hovered(imgui.HoveredFlags_.delay_normal):
        imgui.set_tooltip(text)
