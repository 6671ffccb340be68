"""The textures that a frame is drawn into: one depth buffer, sums that the attribute pass adds up, and the picture."""

from __future__ import annotations

import moderngl


class Targets:
    """Depth and sums of one size.

    size : width and height in pixels
    color, depth, tint : which sums there are besides that of the normals; each is one colour attachment, in the order
        normal, color, depth, tint
    """

    def __init__(
        self, ctx: moderngl.Context, size: tuple[int, int], *, color: bool, depth: bool = False, tint: bool = False
    ) -> None:
        self.size, self.kind = size, (color, depth, tint)
        self.visible_depth = ctx.depth_texture(size)
        # Read with texelFetch, never compared.
        self.visible_depth.compare_func = ""
        self.sums: dict[str, moderngl.Texture] = {"normal": ctx.texture(size, 4, dtype="f2")}
        if color:
            self.sums["color"] = ctx.texture(size, 4, dtype="f2")
        if depth:
            # Distances need more than the 11 bits of a half float.
            self.sums["depth"] = ctx.texture(size, 2, dtype="f4")
        if tint:
            self.sums["tint"] = ctx.texture(size, 4, dtype="f2")
        for texture in self.sums.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        # Depth only: a colour mask of False did not stop colour writes.
        self.visibility = ctx.framebuffer([], self.visible_depth)
        self.attributes = ctx.framebuffer(list(self.sums.values()), self.visible_depth)
        self._color = ctx.texture(size, 4)
        self.picture = ctx.framebuffer([self._color], self.visible_depth)
        # The same without the depth buffer: to clear the sums and keep it, and to copy the picture into framebuffers
        # whose depth has another format, which OpenGL refuses to copy.
        self._sums_only = ctx.framebuffer(list(self.sums.values()))
        self.picture_only = ctx.framebuffer([self._color])

    def location(self, name: str) -> int:
        """Return the colour attachment of a sum."""
        return list(self.sums).index(name)

    def clear_sums(self) -> None:
        """Set every sum to zero."""
        self._sums_only.clear()

    @property
    def nbytes(self) -> int:
        width, height = self.size
        texel = {"f2": 2, "f4": 4}
        return width * height * (8 + sum(t.components * texel[t.dtype] for t in self.sums.values()))

    def release(self) -> None:
        for framebuffer in (self.visibility, self.attributes, self.picture, self._sums_only, self.picture_only):
            framebuffer.release()
        self.visible_depth.release()
        for texture in (self._color, *self.sums.values()):
            texture.release()
