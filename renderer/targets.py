"""The textures that a frame is drawn into: one depth buffer, sums that the attribute pass adds up, and the picture."""

from __future__ import annotations

import moderngl

from hierarchy.model import Float32Array
from renderer.allocation import allocating
from renderer.limits import Limits
from renderer.settings import Rgb


def make_picture(ctx: moderngl.Context, limits: Limits, size: tuple[int, int]) -> moderngl.Framebuffer:
    """Return a framebuffer to draw pictures into; `release_picture` gives it back.

    size : width and height in pixels
    Raises GpuError where it is too large.
    """
    limits.check_picture(size)
    with allocating(ctx, "a picture of {} x {} pixels".format(*size)) as held:
        # No depth: OpenGL refuses to copy it to a window whose depth has another format.
        return held.add(ctx.framebuffer([held.add(ctx.renderbuffer(size, 4))]))


def release_picture(framebuffer: moderngl.Framebuffer) -> None:
    """Give back what `make_picture` made."""
    ctx, attachments = framebuffer.ctx, framebuffer.color_attachments
    if ctx.fbo is not None and ctx.fbo.glo == framebuffer.glo:
        # moderngl binds anew what was bound before, which must not be one that is gone.
        ctx.detect_framebuffer(0).use()
    framebuffer.release()
    for attachment in attachments:
        attachment.release()


class Targets:
    """Depth and sums of one size.

    size : width and height in pixels
    color, depth, tint : which sums there are besides that of the normals; each is one colour attachment, in the order
        normal, color, depth, tint
    """

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], *, color: bool, depth: bool = False, tint: bool = False
    ) -> None:
        """Raises GpuError where there is no memory for them."""
        self.size, self.kind = size, (color, depth, tint)
        with allocating(ctx, "a picture of {} x {} pixels".format(*size)) as held:
            self._held = held
            self.visible_depth = held.add(ctx.depth_texture(size))
            # Read with texelFetch, never compared.
            self.visible_depth.compare_func = ""
            # In half floats a sum stays where it is once what comes is half a unit of its last place: a thousand
            # splats in a pixel bent the normal by more than half a degree.
            self.sums: dict[str, moderngl.Texture] = {"normal": held.add(ctx.texture(size, 4, dtype="f4"))}
            if color:
                self.sums["color"] = held.add(ctx.texture(size, 4, dtype="f4"))
            if depth:
                self.sums["depth"] = held.add(ctx.texture(size, 2, dtype="f4"))
            if tint:
                self.sums["tint"] = held.add(ctx.texture(size, 4, dtype="f4"))
            for texture in self.sums.values():
                texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
            sums = list(self.sums.values())
            # Depth only: a colour mask of False did not stop colour writes.
            self.visibility = held.add(ctx.framebuffer([], self.visible_depth))
            self.attributes = held.add(ctx.framebuffer(sums, self.visible_depth))
            color_texture = held.add(ctx.texture(size, 4))
            self.picture = held.add(ctx.framebuffer([color_texture], self.visible_depth))
            # Where sums may be anything but zero and depths nearer than the far plane, as in `reached_spans`; None:
            # anywhere.
            self.drawn: Float32Array | None = None
            # To copy the picture into framebuffers whose depth has another format, which OpenGL refuses to copy.
            self.picture_only = held.add(ctx.framebuffer([color_texture]))
            # What is seen where nothing is drawn, and its two colours, None: not drawn yet. It does not depend on the
            # camera: copying it takes a twentieth of the time of drawing it.
            self.gradient = held.add(ctx.framebuffer([held.add(ctx.texture(size, 4))]))
            self.gradient_colors: tuple[Rgb, Rgb] | None = None

    def location(self, name: str) -> int:
        """Return the colour attachment of a sum."""
        return list(self.sums).index(name)

    def clear(self) -> None:
        """Set every sum to zero and every depth to the far plane."""
        self.attributes.use()
        self.attributes.depth_mask = True
        self.attributes.clear(depth=1.0)

    @property
    def nbytes(self) -> int:
        width, height = self.size
        texel = {"f2": 2, "f4": 4}
        return width * height * (12 + sum(t.components * texel[t.dtype] for t in self.sums.values()))

    def release(self) -> None:
        self._held.release()
