"""The shaders state what they do, compile in every variant, and agree with their twins in Python."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable
from pathlib import Path

import moderngl
import numpy as np
import pytest

import shaders
from hierarchy.boxes import TURN_STEP, TURNS
from hierarchy.encoding import decode_hemisphere, encode_hemisphere
from hierarchy.frames import tangents
from hierarchy.hierarchy import SPLAT
from hierarchy.lod import Cut
from renderer.cut_buffers import RECORDS_IN_ROW, ROW_BITS, TEXELS_PER_SPLAT, CutBuffers
from renderer.limits import Limits
from renderer.programs import make_program, shader_source
from renderer.splat_passes import Variant
from renderer.targets import Targets

LIMITS = Limits(texture_size=4096, array_layers=256, picture_size=(4096, 4096))
FOLDER = Path(shaders.__file__).parent
STAGES = sorted(path.name for path in FOLDER.iterdir() if path.suffix in (".vert", ".frag"))
INCLUDES = sorted(path.name for path in (FOLDER / "include").iterdir())

# One value in, three vectors out, for each texel of a texture.
EVALUATE = """
layout(location = 0) out vec4 first;
layout(location = 1) out vec4 second;
uniform sampler2D values;
void main()
{{
    ivec2 at = ivec2(gl_FragCoord.xy);
    vec4 value = texelFetch(values, at, 0);
    {body}
}}
"""


def evaluate(
    ctx: moderngl.Context,
    includes: Iterable[str],
    body: str,
    texture: moderngl.Texture,
    defines: str = "",
    **units: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Run GLSL on every texel of a texture; return what it left in `first` and `second`, float32 (H, W, 4)."""
    source = "".join(shader_source(f"include/{name}") for name in includes) + EVALUATE.format(body=body)
    program = ctx.program(
        f"#version 330 core\n{shader_source('fullscreen.vert')}", f"#version 330 core\n{defines}{source}"
    )
    program["plane"].value = 0.0
    for name, unit in units.items():
        program[name].value = unit
    texture.use(0)
    outputs = [ctx.texture(texture.size, 4, dtype="f4") for _ in range(2)]
    framebuffer = ctx.framebuffer(outputs)
    framebuffer.use()
    ctx.enable_only(moderngl.NOTHING)
    ctx.vertex_array(program, []).render(moderngl.TRIANGLES, 3)
    shape = (texture.height, texture.width, 4)
    first, second = (np.frombuffer(output.read(), np.float32).reshape(shape) for output in outputs)
    ctx.detect_framebuffer(0).use()
    for each in (framebuffer, *outputs):
        each.release()
    return first, second


def opening_comment(path: Path) -> str:
    lines = path.read_text(encoding="utf-8").splitlines()
    return "\n".join(itertools.takewhile(lambda line: line.startswith("//"), lines))


@pytest.mark.parametrize("name", STAGES)
def test_a_stage_opens_with_its_role_inputs_outputs_and_source(name: str) -> None:
    comment = opening_comment(FOLDER / name)
    assert comment.startswith("// Role: ")
    assert re.search(r"\bIn(:|, out:) ", comment)
    assert re.search(r"\b(O|In, o)ut: ", comment)
    assert "Source: " in comment


@pytest.mark.parametrize("name", INCLUDES)
def test_an_include_opens_with_its_role_and_source(name: str) -> None:
    comment = opening_comment(FOLDER / "include" / name)
    assert comment.startswith("// Role: ")
    assert "Source: " in comment


@pytest.mark.parametrize("name", STAGES)
def test_includes_expand(name: str) -> None:
    raw, expanded = (FOLDER / name).read_text(encoding="utf-8"), shader_source(name)
    included = re.findall(r'#include "(.+)"', raw)
    assert "#include" not in expanded
    assert all((FOLDER / "include" / each).read_text(encoding="utf-8") in expanded for each in included)
    # A file that comes in twice would define its functions twice.
    assert all(expanded.count(opening_comment(FOLDER / "include" / each)) == 1 for each in included)


def test_every_include_is_used() -> None:
    used = re.findall(r'#include "(.+)"', "".join((FOLDER / name).read_text(encoding="utf-8") for name in STAGES))
    assert set(used) == set(INCLUDES)


def test_a_shader_that_is_not_there_is_an_error() -> None:
    with pytest.raises(FileNotFoundError):
        shader_source("no_such_shader.frag")


@pytest.mark.parametrize("primitive", ["splat", "triangle"])
def test_all_variants_of_the_passes_compile(ctx: moderngl.Context, primitive: str) -> None:
    for normal_mapping, sprite, color, depth, tint, parallel in itertools.product((False, True), repeat=6):
        targets = Targets(ctx, (4, 4), color=color, depth=depth, tint=tint)
        variant = Variant(normal_mapping, sprite, color, depth, tint, parallel)
        make_program(ctx, f"{primitive}.vert", f"{primitive}_visibility.frag", variant.visibility_defines).release()
        defines = variant.defines(targets)
        program = make_program(ctx, f"{primitive}.vert", f"{primitive}_attributes.frag", defines)
        assert ("tile_normals" in program) == (normal_mapping and primitive == "splat")
        assert ("show_lod" in program) == tint
        targets.release()
        program.release()


def test_all_variants_of_the_resolve_compile(ctx: moderngl.Context) -> None:
    switches = ("COLOR", "TINT", "MATCAP", "TWO_SIDED", "CRACKS")
    for chosen in itertools.product((False, True), repeat=5):
        defines = {name: 1 for name, on in zip(switches, chosen, strict=True) if on}
        vertex = "strips.vert" if "CRACKS" in defines else "fullscreen.vert"
        program = make_program(ctx, vertex, "resolve_shade.frag", defines)
        assert ("matcap" in program) == ("MATCAP" in defines)
        program.release()
    for fragment, defines in (
        ("resolve_background.frag", {}),
        ("resolve_background.frag", {"GROUND": 1}),
        ("resolve_arrays.frag", {"DEPTH": 1}),
    ):
        make_program(ctx, "fullscreen.vert", fragment, defines).release()
    for fragment in ("resolve_cracks.frag", "erase.frag"):
        make_program(ctx, "strips.vert", fragment).release()


def sphere_and_seams() -> np.ndarray:
    """Return float32 (N, 4) unit vectors: all over the sphere, the poles, the axes, and both sides of n_z = 0."""
    rng = np.random.default_rng(17)
    spread = rng.normal(size=(4000, 3))
    poles = rng.normal(size=(64, 3)) * np.logspace(-9, -1, 64)[:, None] + [0, 0, 1]
    equator = rng.normal(size=(64, 3))
    equator[:, 2] = np.logspace(-12, -1, 64)
    zeros = np.array([[0.6, 0.8, 0.0], [0.6, 0.8, -0.0], [-0.8, 0.6, -0.0]])
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    every = np.concatenate([spread, poles, -poles, equator, equator * [1, 1, -1], zeros, axes])
    every /= np.linalg.norm(every, axis=1, keepdims=True)
    return np.pad(every.astype(np.float32), ((0, 0), (0, 1)))


def test_tangents_agree_with_the_python_twin(ctx: moderngl.Context) -> None:
    normals = sphere_and_seams()
    texture = ctx.texture((len(normals), 1), 4, normals, dtype="f4")
    body = "vec3 o1, o2; tangents(value.xyz, o1, o2); first = vec4(o1, 0.0); second = vec4(o2, 0.0);"
    o1, o2 = (part.reshape(-1, 4)[: len(normals), :3] for part in evaluate(ctx, ["frame.glsl"], body, texture))
    texture.release()
    twins = np.array([tangents(*normal[:3].astype(np.float64)) for normal in normals])
    assert np.abs(o1 - twins[:, :3]).max() < 1e-6
    assert np.abs(o2 - twins[:, 3:]).max() < 1e-6
    frame = np.stack([o1, o2, normals[:, :3]], axis=1).astype(np.float64)
    assert np.abs(frame @ frame.swapaxes(1, 2) - np.eye(3)).max() < 1e-6
    assert np.linalg.det(frame).min() > 0.999


def test_every_code_of_a_normal_decodes_as_in_python(ctx: moderngl.Context) -> None:
    y, x = np.mgrid[0:256, 0:256]
    codes = np.stack([x, y], axis=-1).astype(np.uint8)
    texture = ctx.texture((256, 256), 2, codes, alignment=1)
    body = "first = vec4(normalize(decode_hemisphere(value.rg)), 0.0); second = vec4(0.0);"
    decoded = evaluate(ctx, ["hemisphere.glsl"], body, texture)[0][..., :3]
    texture.release()
    # Byte 0 lies outside of what the encoding makes: 128 + 127 e is 1 to 255.
    assert np.abs(decoded - decode_hemisphere(codes))[1:, 1:].max() < 1e-6
    # The surfel's own normal survives, but for the rounding of 128 / 255.
    assert np.abs(decoded[128, 128] - [0, 0, 1]).max() < 2e-7


def test_a_normal_comes_back_from_its_code_on_the_gpu(ctx: moderngl.Context) -> None:
    normals = sphere_and_seams()[:, :3].astype(np.float64)
    normals[:, 2] = np.abs(normals[:, 2])
    codes = np.array([encode_hemisphere(*normal) for normal in normals]).astype(np.uint8)
    texture = ctx.texture((len(codes), 1), 2, codes, alignment=1)
    body = "first = vec4(normalize(decode_hemisphere(value.rg)), 0.0); second = vec4(0.0);"
    decoded = evaluate(ctx, ["hemisphere.glsl"], body, texture)[0][0, :, :3]
    texture.release()
    degrees = np.degrees(np.arccos(np.clip((decoded * normals).sum(axis=1), -1.0, 1.0)))
    assert degrees.max() < 0.56  # two bytes: 0.55 degrees at worst


def test_the_splat_record_is_the_same_in_python_and_glsl() -> None:
    source = shader_source("include/splat_record.glsl")
    struct = re.search(r"struct Splat \{(.*?)\};", source, re.DOTALL)
    assert struct
    # The turn is taken out of the box.
    members = re.findall(r"(vec3|vec4|float) (\w+);", struct[1])
    assert tuple(name for _, name in members) == SPLAT.names
    shapes = {"vec4": (4,), "vec3": (3,), "float": ()}
    assert all(SPLAT[name].base == np.float32 and SPLAT[name].shape == shapes[kind] for kind, name in members)
    # What the constructor puts into each member: swizzles of the texels a, b, ... in order.
    built = re.search(r"return Splat\((.+)\);", source)
    assert built
    offsets = [16 * "ab".index(texel) + 4 * "xyzw".index(first) for texel, first in re.findall(r"(\w)\.(\w)", built[1])]
    offsets.append(32)
    assert re.search(r"vec4 box = texelFetch\(splat_records, at \+ ivec2\(2, 0\), 0\);", source)
    assert offsets == [SPLAT.fields[name][1] for name in SPLAT.names]  # type: ignore[index]
    assert SPLAT.itemsize == 16 * TEXELS_PER_SPLAT


def test_records_arrive_as_they_were_sent(ctx: moderngl.Context) -> None:
    buffers = CutBuffers(ctx, LIMITS)
    # A part of a row, full rows and more of them than before, fewer, and no part of one.
    for count in (100, 4 * RECORDS_IN_ROW + 100, 2 * RECORDS_IN_ROW, 5 * RECORDS_IN_ROW):
        records = np.zeros(count, SPLAT)
        # Quarters, which no sum of a turn and a coordinate rounds.
        records.view(np.float32)[:] = np.random.default_rng(3).integers(-64, 64, records.nbytes // 4) / 4
        none = np.empty((0, 3), np.uint32)
        buffers.upload(Cut(np.arange(count, dtype=np.uint32), none, 0, 0, 0), records, None, None)
        assert np.array_equal(fetched(ctx, buffers, count), records.view(np.float32).reshape(-1, 12))
    buffers.release()


def fetched(ctx: moderngl.Context, buffers: CutBuffers, count: int) -> np.ndarray:
    """Return the records of a cut's splats as the shaders see them, float32 (count, 12)."""
    values = ctx.texture((RECORDS_IN_ROW, 6), 1, dtype="f1")
    body = """
    int index = at.y * textureSize(values, 0).x + at.x;
    if (index >= COUNT) { first = second = vec4(0.0); return; }
    Splat splat = fetch_splat(index);
    first = vec4(splat.centre, splat.radius);
    second = vec4(splat.normal, splat.thickness);
    """
    buffers.records.use(1)
    defines = f"#define ROW_BITS {ROW_BITS}\n#define COUNT {count}\n"
    parts = list(evaluate(ctx, ["splat_record.glsl"], body, values, defines, splat_records=1))
    box_body = body.split("first = vec4", maxsplit=1)[0] + "first = splat.box; second = vec4(float(splat.turn));"
    box, turn = evaluate(ctx, ["splat_record.glsl"], box_body, values, defines, splat_records=1)
    box = box + TURN_STEP * turn * [0.0, 0.0, 0.0, 1.0]
    values.release()
    return np.concatenate([part.reshape(-1, 4)[:count] for part in [*parts, box]], axis=1)


def test_boxes_are_turned_in_the_same_steps_in_python_and_glsl() -> None:
    source = shader_source("include/splat_record.glsl")
    assert f"const int TURNS = {TURNS};" in source
    assert f"const float TURN_STEP = {TURN_STEP};" in source
