"""Small, whole models of every kind that the program reads: what the fuzzer starts from."""

from __future__ import annotations

import base64
import io
import json
import struct
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from e57_writer import double, integer, reseal, scan, write_e57
from PIL import Image

# Two tetrahedra, of which the second is a little smaller and beside the first.
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], float)
VERTICES = np.concatenate([CORNERS, 0.75 * CORNERS + [2, 0, 0]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2], [4, 6, 5], [4, 5, 7], [5, 6, 7], [4, 7, 6]])
POINTS = np.random.default_rng(5).normal(size=(24, 3)).round(3)
COLORS = np.random.default_rng(6).integers(0, 256, (24, 3))

Pack = Callable[[bytes], bytes]


def unchanged(data: bytes) -> bytes:
    return data


@dataclass(frozen=True)
class Seed:
    """A model that opens.

    kind : the row of the table that it counts for
    name : the file that is opened
    files : name -> contents
    mutated : which of them is damaged
    pack : what makes a file of the damaged contents, so that checksums and archives do not hide what is inside
    options : for the command
    is_text : the contents are text
    """

    kind: str
    name: str
    files: dict[str, bytes]
    mutated: str
    pack: Pack = unchanged
    options: tuple[str, ...] = ()
    is_text: bool = False


def seed(kind: str, name: str, content: bytes | str, pack: Pack = unchanged, **more: bytes) -> Seed:
    """Return a model of one file, and of others that it refers to (a dot in their names is written "__")."""
    data = content.encode() if isinstance(content, str) else content
    others = {key.replace("__", "."): value for key, value in more.items()}
    return Seed(kind, name, {name: data, **others}, name, pack, is_text=isinstance(content, str))


def all_seeds() -> list[Seed]:
    """Return every seed."""
    return [*ply_seeds(), *obj_seeds(), *texture_seeds(), *stl_seeds(), *text_seeds(), *las_seeds(), *laz_seeds(),
            *e57_seeds(), *gltf_seeds(), *three_mf_seeds(), *trimesh_seeds()]  # fmt: skip


def ply_header(form: str, *lines: str) -> str:
    return "\n".join(["ply", f"format {form} 1.0", "comment made for tests", *lines, "end_header", ""])


XYZ = tuple(f"property float {axis}" for axis in "xyz")
RGB = tuple(f"property uchar {name}" for name in ("red", "green", "blue"))


def ply_seeds() -> list[Seed]:
    """Return PLY files: ascii and both byte orders, triangles, polygons, strips, points, seams and face colours."""
    seeds = []
    lists = "property list uchar int vertex_indices"
    vertex_rows = [" ".join(map(str, row)) for row in VERTICES.tolist()]
    face_rows = ["3 " + " ".join(map(str, row)) for row in FACES.tolist()]
    head = ply_header("ascii", "element vertex 8", *XYZ, "element face 8", lists)
    seeds.append(seed("PLY", "a.ply", head + "\n".join(vertex_rows + face_rows) + "\n"))
    head = ply_header("ascii", "element vertex 8", *XYZ, "element face 3", lists)
    seeds.append(seed("PLY", "a.ply", head + "\n".join([*vertex_rows, "4 0 1 2 3", "3 4 5 6", "5 0 1 2 6 7", ""])))
    rows = [f"{x} {y} {z} 0 0 1 {r} {g} {b}" for (x, y, z), (r, g, b) in zip(POINTS, COLORS, strict=True)]
    normals = tuple(f"property float n{axis}" for axis in "xyz")
    seeds.append(seed("PLY", "a.ply", ply_header("ascii", "element vertex 24", *XYZ, *normals, *RGB) + "\n".join(rows)))
    for form, order in (("binary_little_endian", "<"), ("binary_big_endian", ">")):
        vertices = VERTICES.astype(order + "f4").tobytes()
        triangles = b"".join(struct.pack(order + "B3i", 3, *face) for face in FACES)
        head = ply_header(form, "element vertex 8", *XYZ, "element face 8", lists)
        seeds.append(seed("PLY", "a.ply", head.encode() + vertices + triangles))
        mixed = struct.pack(order + "B4iB3i", 4, 0, 1, 2, 3, 3, 4, 5, 6)
        head = ply_header(form, "element vertex 8", *XYZ, "element face 2", lists)
        seeds.append(seed("PLY", "a.ply", head.encode() + vertices + mixed))
        strip = struct.pack(order + "i8i", 8, 0, 1, 2, 3, -1, 4, 5, 6)
        strips = "property list int int vertex_indices"
        head = ply_header(form, "element vertex 8", *XYZ, "element tristrips 1", strips)
        seeds.append(seed("PLY", "a.ply", head.encode() + vertices + strip))
        cloud = b"".join(struct.pack(order + "3d3B", *p, *c) for p, c in zip(POINTS, COLORS, strict=True))
        doubles = tuple(line.replace("float", "double") for line in XYZ)
        seeds.append(seed("PLY", "a.ply", ply_header(form, "element vertex 24", *doubles, *RGB).encode() + cloud))
        corners = "property list uchar float texcoord"
        wedge = b"".join(struct.pack(order + "B3iB6f3B", 3, *f, 6, 0, 0, 1, 0, 0, 1, 9, 8, 7) for f in FACES)
        head = ply_header(
            form, "comment TextureFile skin.png", "element vertex 8", *XYZ, "element face 8", lists, corners, *RGB
        )
        seeds.append(seed("PLY", "a.ply", head.encode() + vertices + wedge, skin__png=picture("PNG")))
    return seeds


def picture(form: str, size: int = 6, **options: object) -> bytes:
    """Return a small picture in one of Pillow's formats."""
    pixels = np.random.default_rng(7).integers(0, 256, (size, size, 3)).astype(np.uint8)
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, form, **options)
    return stream.getvalue()


VERTEX_LINES = "".join(f"v {x} {y} {z}\n" for x, y, z in VERTICES.tolist())
SKIN_LINES = "vt 0 0\nvt 1 0\nvt 0 1\nvt 0.5 0.5\n"
SKINNED = VERTEX_LINES + SKIN_LINES + "".join(f"f {a + 1}/1 {b + 1}/2 {c + 1}/3\n" for a, b, c in FACES.tolist())


def obj_seeds() -> list[Seed]:
    """Return OBJ files with and without materials, normals, colours and faces, and their material files."""
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES.tolist())
    backwards = "".join(f"f {a - 8}//{a - 8} {b - 8}//{b - 8} {c - 8}//{c - 8}\n" for a, b, c in FACES.tolist())
    normals = "".join(f"vn {x} {y} {z}\n" for x, y, z in (VERTICES - 0.3).tolist())
    colored = "".join(f"v {x} {y} {z} 0.5 0.25 1\n" for x, y, z in VERTICES.tolist())
    half = SKINNED.splitlines(keepends=True)
    materials = (
        "mtllib a.mtl\n"
        + "".join(half[:14])
        + "usemtl red\n"
        + "".join(half[14:17])
        + "usemtl skin\n"
        + "".join(half[17:])
    )
    library = b"newmtl red\nKd 1 0 0\nnewmtl skin\nKd 1 1 1\nmap_Kd -s 1 1 1 skin.png\n"
    more = {"a.mtl": library, "skin.png": picture("PNG")}
    whole = {"a.obj": materials.encode(), **more}
    return [
        seed("OBJ", "a.obj", VERTEX_LINES + faces),
        seed("OBJ", "a.obj", VERTEX_LINES + normals + backwards + "f 1 2 3 4 \\\n5 6\n"),
        seed("OBJ", "a.obj", "# colours\r\n" + colored.replace("\n", "\r\n") + faces),
        seed("OBJ", "a.obj", "".join(f"v {x} {y} {z}\n" for x, y, z in POINTS.tolist())),
        Seed("OBJ", "a.obj", whole, "a.obj", is_text=True),
        Seed("OBJ", "a.obj", whole, "a.mtl", is_text=True),
    ]


def texture_seeds() -> list[Seed]:
    """Return images as textures, in every format that is read."""
    forms = {
        "png": picture("PNG"), "jpg": picture("JPEG"), "tif": picture("TIFF", compression="tiff_lzw"),
        "tiff": picture("TIFF"), "bmp": picture("BMP"), "tga": picture("TGA"), "webp": picture("WEBP"),
        "gif": picture("GIF"), "jp2": picture("JPEG2000", 16), "ppm": picture("PPM"), "sgi": picture("SGI"),
        "pcx": picture("PCX"), "dds": picture("DDS"), "prog.jpg": picture("JPEG", 20, progressive=True),
    }  # fmt: skip
    seeds = []
    for suffix, data in forms.items():
        pack = seal_png if suffix == "png" else unchanged
        files = {"a.obj": ("mtllib a.mtl\nusemtl a\n" + SKINNED).encode(), f"skin.{suffix}": data}
        files["a.mtl"] = f"newmtl a\nmap_Kd skin.{suffix}\n".encode()
        seeds.append(Seed("images as textures", "a.obj", files, f"skin.{suffix}", pack))
    return seeds


def seal_png(data: bytes) -> bytes:
    """Return a PNG file with the checksums that its chunks should have."""
    sealed, at = data[:8], 8
    while at + 12 <= len(data):
        (size,) = struct.unpack_from(">I", data, at)
        end = at + 8 + size
        if end + 4 > len(data):
            break
        sealed += data[at:end] + struct.pack(">I", zlib.crc32(data[at + 4 : end]))
        at = end + 4
    return sealed + data[at:]


def stl_seeds() -> list[Seed]:
    """Return STL files, ascii and binary."""
    facets = "".join(
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {x} {y} {z}\n" for x, y, z in VERTICES[face].tolist())
        + "endloop\nendfacet\n"
        for face in FACES
    )
    binary = b"".join(struct.pack("<12fH", 0, 0, 0, *VERTICES[face].ravel(), 0) for face in FACES)
    return [
        seed("STL", "a.stl", f"solid a\n{facets}endsolid a\n"),
        seed("STL", "a.stl", bytes(80) + struct.pack("<I", len(FACES)) + binary),
    ]


def text_seeds() -> list[Seed]:
    """Return lines of numbers as scanners write them."""
    colored = np.column_stack([POINTS, COLORS])
    unit = np.round(POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True), 4)

    def lines(table: np.ndarray, between: str) -> str:
        return "".join(between.join(f"{value:g}" for value in row) + "\n" for row in table)

    return [
        seed("points as text", "a.xyz", lines(POINTS, " ")),
        seed("points as text", "a.pts", "24\n" + lines(np.insert(colored, 3, 17, axis=1), " ")),
        seed("points as text", "a.csv", "x,y,z,r,g,b\n" + lines(colored, ",")),
        seed("points as text", "a.asc", "# normals\n" + lines(np.column_stack([POINTS, unit]), "\t")),
    ]


def las_file(version: str, point_format: int, *, compressed: bool) -> bytes:
    """Return a LAS or LAZ file of the test's points."""
    import laspy

    header = laspy.LasHeader(version=version, point_format=point_format)
    header.scales, header.offsets = np.full(3, 0.001), np.zeros(3)
    las = laspy.LasData(header)
    las.x, las.y, las.z = POINTS.T
    if "red" in header.point_format.dimension_names:
        las.red, las.green, las.blue = (257 * COLORS.T).astype(np.uint16)
    stream = io.BytesIO()
    las.write(stream, do_compress=compressed)
    return stream.getvalue()


def las_seeds() -> list[Seed]:
    """Return LAS files of versions that differ in their headers."""
    kinds = (("1.2", 0), ("1.2", 3), ("1.4", 7))
    return [seed("LAS", "a.las", las_file(version, form, compressed=False)) for version, form in kinds]


def laz_seeds() -> list[Seed]:
    """Return LAZ files with both of the compressors."""
    return [
        seed("LAZ", "a.laz", las_file(version, form, compressed=True)) for version, form in (("1.2", 3), ("1.4", 7))
    ]


def e57_seeds() -> list[Seed]:
    """Return E57 files with floats, and with integers of few bits; damaged pages get their checksums back."""
    floats = {f"cartesian{axis}": double(column) for axis, column in zip("XYZ", POINTS.T, strict=True)}
    colored = {
        f"color{name}": integer(column, 0, 255) for name, column in zip(("Red", "Green", "Blue"), COLORS.T, strict=True)
    }
    raw = np.round(POINTS * 1000).astype(int)
    scaled = {
        f"cartesian{axis}": integer(column, -4000, 4000, scale=0.001) for axis, column in zip("XYZ", raw.T, strict=True)
    }
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.e57"
        files = [write_e57(path, [scan(24, fields)]).read_bytes() for fields in (floats | colored, scaled)]
    return [seed("E57", "a.e57", data, pack) for data in files for pack in (reseal, unchanged)]


def gltf_scene() -> tuple[dict[str, object], bytes]:
    """Return the JSON of a glTF scene without its buffer's place, and the buffer."""
    positions, indices = VERTICES.astype("<f4").tobytes(), FACES.astype("<u2").tobytes()
    coordinates = VERTICES[:, :2].astype("<f4").tobytes()
    pixels = picture("PNG")
    blobs = [positions, coordinates, indices, pixels]
    offsets = np.cumsum([0] + [len(blob) for blob in blobs]).tolist()
    views = [{"buffer": 0, "byteOffset": o, "byteLength": len(b)} for o, b in zip(offsets, blobs, strict=False)]
    scene: dict[str, object] = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "translation": [1, 2, 3]}, {"mesh": 0, "scale": [2, 2, 2]}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [3, 1, 1]},
            {"bufferView": 1, "componentType": 5126, "count": 8, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 24, "type": "SCALAR"},
        ],
        "bufferViews": views,
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
        "textures": [{"source": 0}],
        "materials": [
            {"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.5, 1], "baseColorTexture": {"index": 0}}}
        ],
    }
    return scene, b"".join(blobs)


def glb(text: bytes, buffer: bytes) -> bytes:
    """Return a GLB file of a JSON text and a buffer, with lengths that agree."""
    text, buffer = text + b" " * (-len(text) % 4), buffer + bytes(-len(buffer) % 4)
    body = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(buffer), b"BIN\0") + buffer
    return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def gltf_seeds() -> list[Seed]:
    """Return a scene as glTF with a buffer beside it, with one inside it, and as GLB; JSON damaged, or all of it."""
    scene, buffer = gltf_scene()
    beside = json.dumps({**scene, "buffers": [{"byteLength": len(buffer), "uri": "a%20b.bin"}]}, indent=0)
    uri = "data:application/octet-stream;base64," + base64.b64encode(buffer).decode()
    inside = json.dumps({**scene, "buffers": [{"byteLength": len(buffer), "uri": uri}]})
    text = json.dumps({**scene, "buffers": [{"byteLength": len(buffer)}]}, indent=0)
    whole = {"a.gltf": beside.encode(), "a b.bin": buffer}
    return [
        Seed("glTF", "a.gltf", whole, "a.gltf", is_text=True),
        Seed("glTF", "a.gltf", whole, "a b.bin"),
        seed("glTF", "a.gltf", inside),
        seed("GLB", "a.glb", glb(text.encode(), buffer)),
        seed("GLB", "a.glb", text, lambda damaged: glb(damaged, buffer)),
    ]


MODEL_3MF = """<?xml version="1.0" encoding="UTF-8"?>
<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">
<resources><object id="1" type="model"><mesh><vertices>
{vertices}</vertices><triangles>
{triangles}</triangles></mesh></object>
<object id="2" type="model"><components><component objectid="1" transform="1 0 0 0 1 0 0 0 1 5 0 0"/>
<component objectid="1"/></components></object></resources>
<build><item objectid="2"/></build></model>
"""


def three_mf(model: bytes) -> bytes:
    """Return a 3MF archive around the XML of a model."""
    stream = io.BytesIO()
    types = '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types"/>'
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("[Content_Types].xml", types)
        archive.writestr("3D/3dmodel.model", model)
    return stream.getvalue()


def three_mf_seeds() -> list[Seed]:
    """Return a 3MF file, damaged as an archive or inside it."""
    text = MODEL_3MF.format(
        vertices="".join(f'<vertex x="{x}" y="{y}" z="{z}"/>\n' for x, y, z in VERTICES.tolist()),
        triangles="".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n' for a, b, c in FACES.tolist()),
    )
    return [seed("3MF", "a.3mf", three_mf(text.encode())), seed("3MF", "a.3mf", text, three_mf)]


def trimesh_seeds() -> list[Seed]:
    """Return files of the other kinds that trimesh reads."""
    import trimesh

    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    off = "OFF\n8 8 0\n" + VERTEX_LINES.replace("v ", "") + "".join(f"3 {a} {b} {c}\n" for a, b, c in FACES.tolist())
    dae = mesh.export(file_type="dae")
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.obj", obj_seeds()[0].files["a.obj"])
    return [
        seed("OFF", "a.off", off),
        seed("COLLADA", "a.dae", dae.decode() if isinstance(dae, bytes) else dae),
        seed("archives of models", "a.zip", stream.getvalue()),
    ]
