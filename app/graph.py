"""A graph of the last frames: how long each took, stage by stage."""

from __future__ import annotations

from collections.abc import Sequence
from statistics import median_low

from imgui_bundle import ImVec2, imgui

from app.state import HISTORY, STAGES, FrameReport
from app.theme import DIM, RAISED, STAGE_COLORS, as_u32, as_vec4

# In units of the interface's scale.
HEIGHT = 64.0

# The axis ends at one of these times, in milliseconds, so that it does not tremble with every frame.
AXIS_ENDS = (2.0, 5.0, 10.0, 20.0, 33.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)

# The median of the last frames is shown: single ones jump about, and the first has to compile its shaders.
MEDIAN_OF = 11
# The axis has room for this share of the frames; the few that took far longer are cut off at the top.
SHARE_SHOWN = 0.8


def draw_graph(history: Sequence[FrameReport], scale: float) -> None:
    """Draw a stacked bar for each frame, the newest at the right, and the stages' times below."""
    recent = list(history)[-MEDIAN_OF:]
    total = median_low(frame.total for frame in recent) if recent else 0.0
    imgui.text(f"{1e3 / total:.0f} frames/s" if total > 0.0 else "no frame yet")
    imgui.same_line()
    imgui.text_colored(as_vec4(DIM), f"{total:.1f} ms" if total > 0.0 else "")

    draw_list = imgui.get_window_draw_list()
    left_top, width, height = imgui.get_cursor_screen_pos(), imgui.get_content_region_avail().x, HEIGHT * scale
    right, bottom = left_top.x + width, left_top.y + height
    draw_list.add_rect_filled(left_top, ImVec2(right, bottom), as_u32(RAISED), 5.0 * scale)
    axis_end = _axis_end(history)
    bar = width / HISTORY
    for age, frame in enumerate(reversed(history)):
        x, y = right - (age + 1) * bar, bottom
        for color, milliseconds in zip(STAGE_COLORS, frame.milliseconds, strict=True):
            top = max(y - milliseconds / axis_end * height, left_top.y)
            draw_list.add_rect_filled(ImVec2(x, top), ImVec2(x + max(bar - 0.5 * scale, 1.0), y), as_u32(color))
            y = top
    draw_list.add_text(ImVec2(left_top.x + 6.0 * scale, left_top.y + 3.0 * scale), as_u32(DIM), f"{axis_end:.0f} ms")
    imgui.dummy(ImVec2(width, height))
    _legend(recent, scale)


def _legend(recent: Sequence[FrameReport], scale: float) -> None:
    column = 0.5 * imgui.get_content_region_avail().x
    for index, (stage, color) in enumerate(zip(STAGES, STAGE_COLORS, strict=True)):
        if index % 2:
            imgui.same_line(column + imgui.get_style().window_padding.x)
        place, side = imgui.get_cursor_screen_pos(), 9.0 * scale
        middle = place.y + 0.5 * imgui.get_text_line_height()
        imgui.get_window_draw_list().add_rect_filled(
            ImVec2(place.x, middle - 0.5 * side),
            ImVec2(place.x + side, middle + 0.5 * side),
            as_u32(color),
            2.0 * scale,
        )
        imgui.dummy(ImVec2(side, 0.0))
        imgui.same_line()
        milliseconds = median_low(frame.milliseconds[index] for frame in recent) if recent else 0.0
        imgui.text(stage)
        imgui.same_line()
        imgui.text_colored(as_vec4(DIM), f"{milliseconds:.1f} ms")


def _axis_end(history: Sequence[FrameReport]) -> float:
    times = sorted(sum(frame.milliseconds) for frame in history)
    longest = times[int(SHARE_SHOWN * (len(times) - 1))] if times else 0.0
    return next((end for end in AXIS_ENDS if end >= longest), longest)
