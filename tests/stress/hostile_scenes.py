"""Scenes and archives that mean harm: they unpack without end, refer in circles, or to files elsewhere."""

from __future__ import annotations

import base64
import bz2
import gzip
import io
import json
import struct
import tarfile
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

from file_seeds import FACES, MODEL_3MF, VERTICES, Seed, glb, gltf_scene, obj_seeds, three_mf
from file_trials import Trial
from hostile_files import MEGABYTE, OUTSIDE, trial
from mutations import INTEGERS, NUMBERS

LAUGHS = '<!DOCTYPE x [<!ENTITY a0 "1 1 1 1 1 1 1 1 1 1 ">' + "".join(
    f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10)
) + "]>"  # fmt: skip


def external(target: str) -> str:
    return f'<!DOCTYPE x [<!ENTITY a9 SYSTEM "{target}"><!ENTITY % b SYSTEM "{target}">%b;]>'


def zipped(**members: bytes) -> bytes:
    """Return an archive; "__" in a member's name is a dot."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name.replace("__", "."), data)
    return stream.getvalue()


def png(width: int, height: int, depth: int = 8, color: int = 0, rows: bytes = b"") -> bytes:
    """Return a PNG that says how large it is, whatever its data hold."""
    header = struct.pack(">IIBBBBB", width, height, depth, color, 0, 0, 0)
    chunks = ((b"IHDR", header), (b"IDAT", rows or zlib.compress(bytes(1000))), (b"IEND", b""))
    blocks = [struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d)) for k, d in chunks]
    return b"\x89PNG\r\n\x1a\n" + b"".join(blocks)


def gltf_files() -> Iterator[Trial]:
    """Yield glTF and GLB files whose references and numbers lie."""
    scene, buffer = gltf_scene()

    def with_buffer(**changes: object) -> bytes:
        return glb(json.dumps({**scene, "buffers": [{"byteLength": len(buffer)}], **changes}).encode(), buffer)

    for name in (*OUTSIDE, "data:,x", "data:application/octet-stream;base64,====", "", "\0", "a.gltf", "x" * 9000):
        text = json.dumps({**scene, "buffers": [{"byteLength": len(buffer), "uri": name}]})
        yield trial(f"buffer {name[:30]!r}", "a.gltf", text, secret__bin=buffer)
        yield trial(f"image {name[:30]!r}", "a.glb", with_buffer(images=[{"uri": name}]))
    for number in (*INTEGERS, -1, -(2**31), 1.5, 1e300, None, "3", [], {}):
        for field in ("bufferView", "componentType", "count", "byteOffset", "type"):
            accessors = [{**accessor, field: number} for accessor in scene["accessors"]]
            yield trial(f"accessors' {field} {number}", "a.glb", with_buffer(accessors=accessors))
        views = [{**view, "byteLength": number, "byteStride": number} for view in scene["bufferViews"]]
        yield trial(f"views' length {number}", "a.glb", with_buffer(bufferViews=views))
        yield trial(
            f"a node's mesh and child {number}", "a.glb", with_buffer(nodes=[{"mesh": number, "children": [number]}])
        )
        yield trial(f"a matrix of {number}", "a.glb", with_buffer(nodes=[{"mesh": 0, "matrix": [number] * 16}]))
    sparse = {
        "componentType": 5126,
        "count": 2**31,
        "type": "VEC3",
        "sparse": {"count": 1, "indices": {}, "values": {}},
    }
    yield trial("a sparse accessor", "a.glb", with_buffer(accessors=[sparse, *scene["accessors"][1:]]))
    no_view = [{"componentType": 5126, "count": 2**30, "type": "VEC3"} for _ in range(3)]
    yield trial("no buffer view", "a.glb", with_buffer(accessors=no_view))
    circle = [{"children": [1]}, {"children": [0], "mesh": 0}]
    yield trial("nodes in a circle", "a.glb", with_buffer(nodes=circle))
    yield trial("a node of itself", "a.glb", with_buffer(nodes=[{"children": [0], "mesh": 0}]))
    laughs = [{"children": [k + 1] * 10} for k in range(12)] + [{"mesh": 0}]
    yield trial("nodes that multiply", "a.glb", with_buffer(nodes=laughs))
    laughs = [{"children": [k + 1, k + 1]} for k in range(40)] + [{"mesh": 0}]
    yield trial("nodes that double", "a.glb", with_buffer(nodes=laughs))
    chain = [{"children": [k + 1]} for k in range(20_000)] + [{"mesh": 0}]
    yield trial("a long chain of nodes", "a.glb", with_buffer(nodes=chain))
    for count, apart in ((20_000, 1.0), (20_000, 0.0)):
        many = [{"mesh": 0, "translation": [apart * k, 0, apart * (k % 100)]} for k in range(count)]
        scenes = [{"nodes": list(range(count))}]
        yield trial(f"{count} nodes of one mesh, {apart} apart", "a.glb", with_buffer(nodes=many, scenes=scenes))
    for text in (
        "[" * MEGABYTE,
        '{"a":' * 200_000,
        "1" * MEGABYTE,
        '"' + "\\u0000" * 150_000 + '"',
        "null",
        "[]",
        "{}",
        "NaN",
    ):
        yield trial(f"JSON {text[:10]!r}", "a.gltf", text)
        yield trial(f"JSON {text[:10]!r}", "a.glb", glb(text.encode(), buffer))
    for length in (0, 1, 12, 2**31, 2**32 - 1):
        yield trial(f"GLB of length {length}", "a.glb", struct.pack("<4sII", b"glTF", 2, length) + with_buffer()[12:])
        chunk = struct.pack("<4sIII4s", b"glTF", 2, 100, length, b"JSON")
        yield trial(f"chunk of length {length}", "a.glb", chunk + with_buffer()[20:])

    def with_image(make: Callable[[], bytes]) -> bytes:
        uri = "data:image/png;base64," + base64.b64encode(make()).decode()
        return with_buffer(images=[{"uri": uri}])

    for label, make in bombs().items():
        yield trial(f"{label} inside", "a.glb", writer(partial(with_image, make)))


def bombs() -> dict[str, Callable[[], bytes]]:
    """Return images that unpack to far more than they take, by what they are."""
    sides = (
        (11_500, 8, 6),
        (11_500, 1, 0),
        (11_500, 16, 0),
        (13_000, 16, 6),
        (9_000, 8, 2),
        (8_000, 8, 6),
        (8_100, 16, 0),
    )
    return {
        "60,000 x 60,000 texels": lambda: png(60_000, 60_000),
        "2,000,000,000 texels in a row": lambda: png(2_000_000_000, 1),
        "no texel": lambda: png(0, 0),
        "more rows than its data": lambda: png(6, 8_323_078),
        **{f"{side} x {side} texels of {depth} bits, kind {color}": partial(blank, side, depth, color)
           for side, depth, color in sides},
    }  # fmt: skip


@cache
def blank(side: int, depth: int, color: int) -> bytes:
    """Return a square PNG that is black but for a dot."""
    channels = {0: 1, 2: 3, 6: 4}[color]
    packer = zlib.compressobj(1)
    row = bytes(1 + (side * depth * channels + 7) // 8)
    dotted = row[:-1] + b"\x7f"
    rows = packer.compress(dotted) + b"".join(packer.compress(row) for _ in range(side - 1)) + packer.flush()
    return png(side, side, depth, color, rows)


def bomb_textures() -> Iterator[Trial]:
    """Yield OBJ files with images that unpack to far more than they take."""
    skinned = obj_seeds()[4]
    for label, make in bombs().items():
        files = {**skinned.files, "skin.png": writer(make)}
        yield Trial("images as textures", files, "a.obj", ("--no-cache",), False, label)
    library = "".join(f"newmtl {k}\nmap_Kd {k}.png\n" for k in range(30))
    faces = "".join(f"usemtl {k}\nf 1/1 2/2 3/3\n" for k in range(30))
    obj = skinned.files["a.obj"].replace(b"usemtl red\n", faces.encode())
    image = writer(partial(blank, 8_000, 8, 6))
    files = {"a.obj": obj, "a.mtl": library.encode(), **{f"{k}.png": image for k in range(30)}}
    yield Trial("images as textures", files, "a.obj", ("--no-cache",), False, "thirty large images")


def writer(make: Callable[[], bytes]) -> Callable[[Path], object]:
    """Return what writes a file that takes long to make, and only once it is tried."""
    return lambda path: path.write_bytes(make())


def xml_files(seeds: list[Seed]) -> Iterator[Trial]:
    """Yield COLLADA and 3MF files whose XML grows, nests or asks for other files."""
    (dae,) = [seed.files["a.dae"].decode() for seed in seeds if seed.kind == "COLLADA"]
    (mf,) = [seed.files[seed.name].decode() for seed in seeds if seed.kind == "3MF" and seed.is_text]
    targets = ("file:///etc/passwd", "../secret.bin", "/dev/zero", "pipe", "http://127.0.0.1:9/x")
    for name, text, pack in (("a.dae", dae, str.encode), ("a.3mf", mf, lambda text: three_mf(text.encode()))):
        opening, body = text.split("?>", 1) if text.startswith("<?xml") else ('<?xml version="1.0"', text)
        for label, doctype in (("laughs", LAUGHS), *((target, external(target)) for target in targets)):
            for old in (">\n", '="0', " 1 "):
                grown = body.replace(old, {">\n": ">&a9;", '="0': '="&a9;', " 1 ": " &a9; "}[old], 1)
                yield trial(f"entity {label} for {old!r}", name, pack(f"{opening}?>{doctype}{grown}"))
        for number in NUMBERS:
            for old in ('="1', 'id="1"', 'count="', " 0 "):
                yield trial(
                    f"{number[:20]} for {old!r}", name, pack(text.replace(old, f"{old.rstrip('1 0')}{number} "))
                )
        deep = "<a>" * 100_000
        yield trial("deep", name, pack(f"{opening}?>{deep}"))
        yield trial("deep inside", name, pack(text.replace("<mesh>", "<mesh>" + deep)))
        yield trial(
            "many attributes", name, pack(f"{opening}?><a " + " ".join(f'a{k}="1"' for k in range(60_000)) + "/>")
        )
        yield trial("UTF-16", name, pack(text).replace(b"UTF-8", b"UTF-16"))
        yield trial("a long name", name, pack(f"{opening}?><{'a' * 900_000}/>"))


def mf_files() -> Iterator[Trial]:
    """Yield 3MF archives whose objects refer to one another, or that unpack without end."""
    mesh = MODEL_3MF.format(
        vertices="".join(f'<vertex x="{x}" y="{y}" z="{z}"/>\n' for x, y, z in VERTICES.tolist()),
        triangles="".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>\n' for a, b, c in FACES.tolist()),
    )
    part = '<object id="{}" type="model"><components>{}</components></object>'
    circle = mesh.replace('<component objectid="1"/>', '<component objectid="2"/>')
    yield trial("an object of itself", "a.3mf", three_mf(circle.encode()))
    levels = "".join(part.format(k, f'<component objectid="{k - 1}"/>' * 10) for k in range(3, 13))
    laughs = mesh.replace("</resources>", levels + "</resources>").replace(
        '<item objectid="2"/>', '<item objectid="12"/>'
    )
    yield trial("objects that multiply", "a.3mf", three_mf(laughs.encode()))
    yield trial("no object", "a.3mf", three_mf(mesh.replace('objectid="1"', 'objectid="77"').encode()))
    blanks = writer(lambda: three_mf(b"<?xml version='1.0'?><model>" + b" " * (300 * MEGABYTE)))
    yield trial("a bomb of blanks", "a.3mf", blanks)
    for tag in ('<triangle v1="0" v2="1" v3="2"/>', '<vertex x="0" y="1" z="2"/>'):
        yield trial(f"a bomb of {tag}", "a.3mf", writer(partial(often, mesh, tag)))
    yield trial("names that lead out", "a.3mf", zipped(**{"../../3D/3dmodel.model": mesh.encode()}))
    yield trial("no model inside", "a.3mf", zipped(readme=b"none"))


def often(mesh: str, tag: str) -> bytes:
    """Return a 3MF archive of three million of one tag."""
    start, end = mesh.split(tag.split(maxsplit=1)[0] + " ", 1)
    return three_mf(f"{start}{(tag + chr(10)) * 3_000_000}{tag.split(maxsplit=1)[0]} {end}".encode())


def archives() -> Iterator[Trial]:
    """Yield archives in archives, and such that unpack without end or to elsewhere."""
    obj = obj_seeds()[0].files["a.obj"]
    inner = zipped(a__obj=obj)
    for _ in range(30):
        inner = zipped(a__zip=inner)
    yield trial("zip in zip in zip", "a.zip", inner)
    million = zipped(a__obj=obj + b"\n" * (200 * MEGABYTE))
    yield trial("a bomb", "a.zip", million)
    bomb = zipped(
        **{f"{k}__zip": zipped(**{f"{j}__obj": obj + b"#" * (10 * MEGABYTE) for j in range(4)}) for k in range(8)}
    )
    yield trial("bombs in an archive", "a.zip", bomb)
    yield trial("many members", "a.zip", zipped(**{f"{k}__obj": obj for k in range(3000)}))
    yield trial(
        "names that lead out", "a.zip", zipped(**{"../../out.obj": obj, "/tmp/out.obj": obj, "C:\\out.obj": obj})
    )
    locked = bytearray(zipped(a__obj=obj))
    for signature, offset in ((b"PK\3\4", 6), (b"PK\1\2", 8)):
        locked[locked.index(signature) + offset] |= 1
    yield trial("locked", "a.zip", bytes(locked))
    for suffix, pack in (("tar.gz", gzip.compress), ("tar.bz2", bz2.compress), ("bz2", bz2.compress)):
        stream = io.BytesIO()
        with tarfile.open(fileobj=stream, mode="w") as archive:
            for name, kind in (
                ("../out.obj", tarfile.REGTYPE),
                ("link.obj", tarfile.SYMTYPE),
                ("a.obj", tarfile.REGTYPE),
            ):
                member = tarfile.TarInfo(name)
                member.type, member.linkname, member.size = (
                    kind,
                    "/etc/passwd",
                    0 if kind == tarfile.SYMTYPE else len(obj),
                )
                archive.addfile(member, io.BytesIO(obj))
        yield trial("members that lead out", f"a.{suffix}", pack(stream.getvalue()))
        yield trial("a bomb", f"a.{suffix}", writer(partial(pack, bytes(50 * MEGABYTE))))
        yield trial("a bomb of an OBJ", f"a.obj.{suffix}", writer(partial(pack, obj + b"#" * (50 * MEGABYTE))))


def numbers_in(seeds: list[Seed], kinds: tuple[str, ...], most: int) -> Iterator[Trial]:
    """Yield files with an integer at which something overflows written over every place of their headers."""
    for number, seed in enumerate(each for each in seeds if each.kind in kinds):
        data = seed.files[seed.mutated]
        for at in range(number % 2, min(len(data), most), 2):
            value = INTEGERS[(at * 7 + number) % len(INTEGERS)]
            for width in (4, 8):
                changed = bytearray(data)
                changed[at : at + width] = (value % 2 ** (8 * width)).to_bytes(width, "little")
                files = {**seed.files, seed.mutated: seed.pack(bytes(changed))}
                label = f"{value} at byte {at} of {width} bytes"
                yield replace(trial(label, seed.name, b""), files=files)
