"""The panel beside the picture. It edits the viewer's state and asks for commands; it computes nothing."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from imgui_bundle import ImVec2, ImVec4, imgui

from app.commands import Command
from app.graph import draw_graph
from app.memory import peak_memory_mb
from app.option_values import TEXELS
from app.scene import Scene
from app.state import ViewerState
from app.theme import ACCENT, ACCENT_BRIGHT, DIM, PANEL, as_vec4
from renderer.settings import MATERIALS, SPLATS, Settings

# In units of the interface's scale.
WIDTH = 316.0
LABEL_WIDTH = 100.0
VALUE_WIDTH = 64.0
SECOND_COLUMN = 200.0

GOAL_COLUMN = 138.0

MAX_R_SIL, MAX_R_INNER = 32.0, 64.0
R_SIL_HINT, R_INNER_HINT = "Largest radius of a surfel on the silhouette", "Largest radius of any other surfel"
# Ends of what the goals can be: degrees, pixels, frames a second.
DEGREES, PIXELS, RATES = (0.1, 5.0), (0.1, 3.0), (5.0, 120.0)

SPLAT_NAMES = {"quad": "Quads", "sprite": "Point sprites"}

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
    _heading("Picture", bold, scale)
    state.settings = _shading(state.settings, scene, scale)
    if _flag("Orthographic", state.orthographic, "5") != state.orthographic:
        commands.append(Command.ORTHOGRAPHIC)
    _heading("Overlays", bold, scale)
    state.settings = _overlays(state.settings)
    _heading("Statistics", bold, scale)
    _statistics(state, scene, gpu_bytes, scale)
    _comparison(state, scale)
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
    gaps = (len(_BUTTONS) - 1) * imgui.get_style().item_spacing.x
    width = (imgui.get_content_region_avail().x - gaps) / len(_BUTTONS)
    commands = []
    for index, (label, command, hint) in enumerate(_BUTTONS):
        if index:
            imgui.same_line()
        if imgui.button(label, ImVec2(width, 0.0)):
            commands.append(command)
        _hint(hint)
    return commands


def _detail(state: ViewerState, scene: Scene | None, scale: float) -> None:
    steered = state.steered if state.limit_error else None
    imgui.begin_disabled(steered is not None)
    r_sil = _slider("r_sil", steered.r_sil if steered else state.r_sil, MAX_R_SIL, R_SIL_HINT, scale)
    r_inner = _slider("r_inner", steered.r_inner if steered else state.r_inner, MAX_R_INNER, R_INNER_HINT, scale)
    texels = _texels(steered.texels if steered else state.texels, scale)
    imgui.end_disabled()
    if steered is None:
        state.r_sil, state.r_inner, state.texels = r_sil, r_inner, texels
    drawn = state.history[-1].texels if scene is not None and state.history else 0
    if drawn not in (0, texels):
        _dim(f"still drawn with {drawn} × {drawn}")
    _goals(state, scale)


def _texels(texels: int, scale: float) -> int:
    """Return the texels along one side of a tile, one of TEXELS."""
    _label("w_s", "Most texels along one side of a normal tile; after a change those in view are baked anew", scale)
    imgui.set_next_item_width(-VALUE_WIDTH * scale)
    chosen = TEXELS.index(texels) if texels in TEXELS else 0
    # A slider of whole numbers would have a handle as wide as a step.
    flags = imgui.SliderFlags_.no_input
    changed, place = imgui.slider_float("##w_s", float(chosen), 0.0, len(TEXELS) - 1.0, "", flags)
    if changed:
        texels = TEXELS[round(place)]
    _value(f"{texels} × {texels}" if texels else "none")
    return texels


def _goals(state: ViewerState, scale: float) -> None:
    _, state.limit_error = imgui.checkbox("Error at most", state.limit_error)
    _hint("Radii and w_s follow from the largest mean error that you allow: of the normals, and of the outline")
    spacing = imgui.get_style().item_inner_spacing.x
    imgui.same_line(GOAL_COLUMN * scale)
    width = 0.5 * (imgui.get_content_region_avail().x - spacing)
    imgui.begin_disabled(not state.limit_error)
    state.max_degrees = _goal("degrees", state.max_degrees, DEGREES, "%.1f°", width)
    imgui.same_line(0.0, spacing)
    state.max_pixels = _goal("pixels", state.max_pixels, PIXELS, "%.1f px", width)
    imgui.end_disabled()
    steered = state.steered
    if state.limit_error and steered is not None:
        label = "promised at rest" if state.hold_rate else "promised"
        _promise(steered.promise, (state.max_degrees, state.max_pixels), label)
    _, state.hold_rate = imgui.checkbox("Hold", state.hold_rate)
    _hint("Draws coarser while the camera moves, so that a frame takes no longer; in full detail when it rests")
    imgui.same_line(GOAL_COLUMN * scale)
    imgui.begin_disabled(not state.hold_rate)
    width = imgui.get_content_region_avail().x
    state.frames_per_second = _goal("rate", state.frames_per_second, RATES, "%.0f frames/s", width)
    imgui.end_disabled()
    if state.hold_rate and steered is not None:
        coarser = steered.coarseness > 1.0
        _row("while moving", f"coarsened × {steered.coarseness:.1f}" if coarser else "full detail")


def _promise(promise: tuple[float, float] | None, goal: tuple[float, float], label: str) -> None:
    """Say which error is promised, and if that is more than the goal."""
    if promise is None:
        _row("promised", "nothing without tiles")
        return
    kept = promise[0] <= goal[0] and promise[1] <= goal[1]
    _row(label if kept else "cannot promise less than", f"{promise[0]:.2f}°, {promise[1]:.2f} px")
    if not kept:
        _hint("The finest detail of this model in this view")


def _goal(name: str, value: float, ends: tuple[float, float], form: str, width: float) -> float:
    """Return what is allowed, as a slider of a width with its value in it."""
    imgui.set_next_item_width(width)
    # The value has to be read through the handle.
    imgui.push_style_color(imgui.Col_.slider_grab, ImVec4(*ACCENT[:3], 0.4))
    flags = imgui.SliderFlags_.logarithmic | imgui.SliderFlags_.always_clamp
    changed, chosen = imgui.slider_float(f"##{name}", value, *ends, form, flags)
    imgui.pop_style_color()
    # What the command line asked for stays, beyond the ends or between the steps as it may be.
    return chosen if changed else value


def _shading(settings: Settings, scene: Scene | None, scale: float) -> Settings:
    settings = _toggle(settings, "Normal mapping", "normal_mapping", "N")
    settings = _toggle(settings, "Two-sided lighting", "two_sided")
    imgui.same_line(SECOND_COLUMN * scale)
    settings = _toggle(settings, "Ground", "ground")
    if scene is not None and scene.content.colored:
        settings = _toggle(settings, "The model's colours", "use_colors")
    _label("Material", "Clay is lit by two lights, the others are spheres painted in advance", scale)
    # Leave room for two boxes of colour.
    imgui.set_next_item_width(-2.0 * (imgui.get_frame_height() + imgui.get_style().item_spacing.x))
    changed, index = imgui.combo("##material", MATERIALS.index(settings.material), [m.capitalize() for m in MATERIALS])
    if changed:
        settings = replace(settings, material=MATERIALS[index])
    for field, place in (("background_top", "top"), ("background_bottom", "bottom")):
        imgui.same_line()
        flags = imgui.ColorEditFlags_.no_inputs | imgui.ColorEditFlags_.no_label | imgui.ColorEditFlags_.no_tooltip
        changed, color = imgui.color_edit3(f"##{field}", list(getattr(settings, field)), flags)
        _hint(f"The background at the {place} of the picture")
        if changed:
            settings = _replace(settings, field, tuple(color))
    return settings


def _overlays(settings: Settings) -> Settings:
    settings = _toggle(settings, "Silhouette surfels", "silhouette_overlay", "E")
    settings = _toggle(settings, "Splat outlines", "splat_outlines", "B")
    return _toggle(settings, "Level-of-detail colours", "lod_colors", "L")


def _comparison(state: ViewerState, scale: float) -> None:
    """What the papers do, out of sight until it is wanted."""
    if not imgui.tree_node_ex("For comparison", imgui.TreeNodeFlags_.span_avail_width):
        return
    _label("Splats", "Quads in the splats' planes, or the papers' point sprites", scale)
    splat = state.settings.splat
    changed, index = imgui.combo("##splat", SPLATS.index(splat), [SPLAT_NAMES[name] for name in SPLATS])
    if changed:
        state.settings = replace(state.settings, splat=SPLATS[index])
    _, state.printed_cone_test = imgui.checkbox("Printed cone test", state.printed_cone_test)
    _hint("Tell the silhouette by the test as the paper prints it, which takes more surfels for it than are")
    imgui.tree_pop()


def _statistics(state: ViewerState, scene: Scene | None, gpu_bytes: int, scale: float) -> None:
    imgui.same_line(SECOND_COLUMN * scale)
    _, state.continuous = imgui.checkbox("Continuous", state.continuous)
    _hint("Draws again and again, to measure; otherwise only what changes is drawn")
    draw_graph(state.history, scale)
    if state.history:
        last = state.history[-1]
        _row("Splats, leaf triangles", f"{last.splats:,}, {last.triangles:,}")
        _row("On the silhouette, nodes visited", f"{last.silhouette:,}, {last.visited:,}")
    if scene is not None:
        missing = state.history[-1].missing if state.history else 0
        _row("Hierarchy, tiles to bake", f"{scene.hierarchy.nbytes / 1e6:,.1f} MB, {missing:,}")
    peak = peak_memory_mb()
    _row("GPU, process", f"{gpu_bytes / 1e6:,.1f} MB" + (f", {peak:,.0f} MB" if peak is not None else ""))


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


def _flag(label: str, value: bool, key: str = "") -> bool:
    """Return whether a box is ticked; the key that ticks it, too, stands at the right end of the line."""
    _, value = imgui.checkbox(label, value)
    if key:
        imgui.push_style_color(imgui.Col_.text, as_vec4(DIM))
        _value(key)
        imgui.pop_style_color()
    return value


def _toggle(settings: Settings, label: str, field: str, key: str = "") -> Settings:
    return _replace(settings, field, _flag(label, bool(getattr(settings, field)), key))


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
