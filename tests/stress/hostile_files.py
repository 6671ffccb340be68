"""Files that mean harm, made by hand: what random damage would hardly ever find. Each must open, or be refused."""

from __future__ import annotations

import gzip
import io
import os
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from file_seeds import FACES, POINTS, VERTEX_LINES, Seed, picture, ply_header, text_seeds
from file_trials import Trial
from mutations import NUMBERS

Content = bytes | str | Callable[[Path], object]

SUFFIXES = ("ply", "obj", "stl", "off", "glb", "gltf", "3mf", "dae", "las", "laz", "e57", "xyz", "pts", "csv", "zip",
            "tar.gz", "zae", "3dxml", "xaml", "dxf", "bz2", "stl_ascii")  # fmt: skip

# What the suffixes stand for in the table.
FORMATS = {"ply": "PLY", "obj": "OBJ", "stl": "STL", "stl_ascii": "STL", "off": "OFF", "glb": "GLB", "gltf": "glTF",
           "3mf": "3MF", "dae": "COLLADA", "zae": "COLLADA", "las": "LAS", "laz": "LAZ", "e57": "E57",
           "xyz": "points as text", "pts": "points as text", "csv": "points as text", "zip": "archives of models",
           "gz": "archives of models", "bz2": "archives of models"}  # fmt: skip

MEGABYTE = 1_000_000


def trial(label: str, name: str, content: Content, *options: str, **others: Content) -> Trial:
    """Return a trial of one file, and of others ("__" in their names is a dot)."""
    contents = {name: content, **{key.replace("__", "."): other for key, other in others.items()}}
    files = {key: each.encode() if isinstance(each, str) else each for key, each in contents.items()}
    return Trial(
        FORMATS.get(name.rpartition(".")[2], "other scenes"), files, name, ("--no-cache", *options), False, label
    )


def truncated(seeds: list[Seed], rng: np.random.Generator, cuts: int) -> Iterator[Trial]:
    """Yield each seed cut off at every line of its first kilobyte, around them, and at random bytes."""
    for seed in seeds:
        data = seed.files[seed.mutated]
        ends = [at + near for at in range(min(len(data), 1024)) if data[at] == 10 for near in (0, 1)]
        some = rng.integers(0, len(data), cuts).tolist()
        for at in sorted({*ends[:60], *some}):
            files = {**seed.files, seed.mutated: seed.pack(data[:at])}
            yield Trial(seed.kind, files, seed.name, ("--no-cache",), False, f"{seed.mutated}[:{at}]")


def misnamed(seeds: list[Seed]) -> Iterator[Trial]:
    """Yield the contents of each kind under the names of all others, and packed."""
    first = {seed.kind: seed.files[seed.mutated] for seed in seeds if seed.mutated == seed.name}
    for kind, data in first.items():
        stream = io.BytesIO()
        with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("a.obj", data)
        for suffix in SUFFIXES:
            yield trial(f"{kind} in a .{suffix}", f"a.{suffix}", data)
            yield trial(f"gzipped {kind} in a .{suffix}", f"a.{suffix}", gzip.compress(data))
            yield trial(f"zipped {kind} in a .{suffix}", f"a.{suffix}", stream.getvalue())


def ply_files() -> Iterator[Trial]:
    """Yield PLY files whose headers lie."""
    rows = "0 0 0\n1 0 0\n0 1 0\n"
    xyz = [f"property float {axis}" for axis in "xyz"]
    face = "property list uchar int vertex_indices"
    for form in ("ascii", "binary_little_endian", "binary_big_endian"):
        for count in NUMBERS:
            for element in ("vertex", "face"):
                head = ply_header(form, f"element {element} {count}", *(xyz if element == "vertex" else [face]))
                yield trial(f"{form}, {count[:20]} of {element}", "a.ply", head + rows)
        # Text where binary was promised, and the other way round.
        head = ply_header(form, "element vertex 3", *xyz, "element face 1", face)
        yield trial(f"text as {form}", "a.ply", head + rows + "3 0 1 2\n")
        body = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
        for indices in ((0, 1, 2), (-1, 0, 1), (0, 1, 2**31 - 1), (-(2**31), 0, 1)):
            triangle = b"\3" + np.array(indices, "<i4").tobytes()
            yield trial(f"binary as {form}, {indices}", "a.ply", head.encode() + body + triangle)
        for kind in ("char", "int", "uint", "int64", "uint64", "float", "double"):
            lists = ply_header(
                form, "element vertex 3", *xyz, "element face 9", f"property list {kind} int vertex_index"
            )
            for filling in (b"\xff", b"\x7f", b"\x80", b"\0", b"9 ", b"-1 ", b"nan "):
                yield trial(f"{form}, lists of {kind} {filling!r}", "a.ply", lists.encode() + body + filling * 300)
        yield trial(f"{form} without properties", "a.ply", ply_header(form, "element vertex 999999999999") + rows)
        yield trial(f"{form}, a name twice", "a.ply", ply_header(form, "element vertex 3", *xyz, *xyz) + 2 * rows)
        many = [f"property uchar p{k}" for k in range(30_000)]
        yield trial(
            f"{form}, many properties",
            "a.ply",
            ply_header(form, "element vertex 1", *xyz, *many).encode() + bytes(90_000),
        )
        yield trial(
            f"{form}, a long line",
            "a.ply",
            ply_header(form, "comment " + "x" * 900_000, "element vertex 3", *xyz) + rows,
        )
        skin = ply_header(form, "comment TextureFile a\x1b[2J\x07/../../../etc/passwd", "element vertex 3", *xyz,
                          "property float s", "property float t", "element face 1", face)  # fmt: skip
        yield trial(f"{form}, a texture outside", "a.ply", skin + rows)
    for value in NUMBERS:
        head = ply_header("ascii", "element vertex 3", *xyz)
        yield trial(f"coordinate {value[:20]}", "a.ply", f"{head}0 0 0\n1 {value} 0\n0 1 0\n")


def obj_files() -> Iterator[Trial]:
    """Yield OBJ files that ask for much, or for files elsewhere."""
    faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES.tolist())
    whole = VERTEX_LINES + faces
    for value in NUMBERS:
        yield trial(f"index {value[:20]}", "a.obj", whole + f"f 1 2 {value}\nf {value}/{value}/{value} 1 2\n")
        yield trial(f"coordinate {value[:20]}", "a.obj", f"v {value} 0 0\nvt {value} {value}\nvn {value} 0 0\n" + whole)
    for name in (*OUTSIDE, "a\0.mtl", "data:text/plain,newmtl", "x" * 9000, "pipe.mtl", "self.mtl", "a.obj", "."):
        obj = f"mtllib {name}\nusemtl a\n{whole}".encode()
        yield trial(f"mtllib {name[:30]!r}", "a.obj", obj, pipe__mtl=os.mkfifo, self__mtl=lambda at: at.symlink_to(at))
        skin = f"newmtl a\nmap_Kd {name}\n"
        coordinates = (
            obj.replace(b"mtllib", b"#").replace(b"usemtl", b"mtllib b.mtl\nvt 0 0\nusemtl") + b"f 1/1 2/1 3/1\n"
        )
        yield trial(f"map_Kd {name[:30]!r}", "a.obj", coordinates, b__mtl=skin, pipe__mtl=os.mkfifo)
    yield trial("a million empty lines", "a.obj", whole + "\n" * MEGABYTE)
    yield trial("a million blanks", "a.obj", whole + " " * MEGABYTE + "usemtl a")
    yield trial("continued lines", "a.obj", whole + "\\\n" * (MEGABYTE // 2))
    yield trial("one polygon", "a.obj", VERTEX_LINES + "f" + " 1 2 3 4" * 120_000)
    yield trial("slashes", "a.obj", VERTEX_LINES + "f " + "/" * MEGABYTE)
    yield trial("one number", "a.obj", whole + "v " + "9" * MEGABYTE + " 0 0\n")
    uses = "".join(f"usemtl {k}\nf 1/1 2/1 3/1\n" for k in range(35_000))
    library = "".join(f"newmtl {k}\nmap_Kd {k}\n" for k in range(35_000))
    yield trial("a material a face", "a.obj", "mtllib a.mtl\nvt 0 0\n" + VERTEX_LINES + uses, a__mtl=library)
    yield trial("one material file often", "a.obj", "mtllib a.mtl\n" * 70_000 + "usemtl 1\n" + whole, a__mtl=library)
    names = "".join(f"mtllib {k}\n" for k in range(70_000))
    yield trial("many material files", "a.obj", names + "usemtl 1\n" + whole)
    yield trial("a sparse material file", "a.obj", "mtllib a.mtl\nusemtl a\n" + whole, a__mtl=sparse)


# Names that lead, or would on some system lead, out of a model's folder.
OUTSIDE = ("../secret.bin", "/etc/passwd", "..\\secret.bin", "C:\\secret.bin", "\\\\server\\share\\secret.bin",
           "//server/share/secret.bin", "%2e%2e/secret.bin", "..%2fsecret.bin", "..%5Csecret.bin", "%2Fetc%2Fpasswd",
           "file:///etc/passwd", "file://../secret.bin", "http://127.0.0.1:9/secret.bin", "link.bin",
           "folder/secret.bin", "folder/../../secret.bin", "./../secret.bin", "....//secret.bin",
           "/proc/self/environ", "/dev/zero", "~/x",
           "$HOME/x", "secret.bin%00.png")  # fmt: skip


def sparse(path: Path) -> None:
    """Make a file of a gigabyte that takes no room."""
    with path.open("wb") as stream:
        stream.truncate(1 << 30)


def other_files() -> Iterator[Trial]:
    """Yield STL, OFF and text files that lie."""
    triangle = np.zeros(12, "<f4").tobytes() + b"\0\0"
    for count in (0, 1, 2, 2**31 - 1, 2**31, 2**32 - 1):
        yield trial(f"{count} triangles", "a.stl", bytes(80) + np.array(count, "<u4").tobytes() + triangle)
        yield trial(
            f"solid, {count} triangles", "a.stl", b"solid" + bytes(75) + np.array(count, "<u4").tobytes() + triangle
        )
    yield trial("solid and no more", "a.stl", "solid a\nendsolid\n")
    yield trial("half a facet", "a.stl", "solid a\nfacet\nvertex 0 0\nvertex nan inf 1e300\nendsolid\n")
    yield trial("vertices only", "a.stl", "solid a\n" + "vertex 1 2 3\n" * 70_000 + "endsolid\n")
    for value in NUMBERS:
        yield trial(f"OFF of {value[:20]}", "a.off", f"OFF\n{value} {value} 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
        yield trial(f"OFF with {value[:20]}", "a.off", f"OFF\n3 1 0\n0 0 0\n1 {value} 0\n0 1 0\n3 0 1 {value}\n")
        for suffix in ("xyz", "pts", "csv"):
            yield trial(f"{value[:20]} as a number", f"a.{suffix}", f"1 2 3\n{value} 0 0\n0 {value} {value}\n4 5 6\n")
    yield trial("one line", "a.xyz", "1 " * (MEGABYTE // 2))
    yield trial("one word", "a.xyz", "1" * MEGABYTE)
    yield trial("empty lines", "a.xyz", "\n" * MEGABYTE)
    yield trial("comments", "a.xyz", "1 2 3\n" + "#" * MEGABYTE)
    yield trial("no point at all", "a.xyz", "a b c\n" * (MEGABYTE // 6))
    yield trial("one point often", "a.xyz", "1 2 3\n" * (MEGABYTE // 6))
    yield trial("no colour, no normal", "a.xyz", "1 2 3 nan nan nan\n3 4 5 inf inf inf\n")
    yield trial("a nul after the start", "a.xyz", b"1 2 3\n" * 1000 + b"\0\xff" * 100)


def names() -> Iterator[Trial]:
    """Yield names that would not stay in one line, or that no terminal should be sent, of good and of bad files."""
    good, bad = text_seeds()[0].files["a.xyz"], b"no number\n"
    strange = ("a\nb", "a\r\nsurfelscope: fine", "\x1b[2J\x1b[31m", "\udcff\udcfe", "\u202egnp", "\u2028", "\x85",
               "-a", "--json", " ", "%s%n{0}", "'\"`$(touch x)", "x" * 240, "\U0001f600" * 50,
               "\x7f\x08\x08", "a\tb")  # fmt: skip
    for name in strange:
        for content in (good, bad):
            label = f"{name[:20]!r}, {'good' if content == good else 'bad'}"
            files = {f"{name}.xyz": content, "a.png": b""}
            yield Trial("points as text", files, f"{name}.xyz", ("--no-cache",), content == good, label)
        obj = f"mtllib {name}.mtl\nusemtl {name}\n{VERTEX_LINES}f 1 2 3\n".encode("utf-8", "surrogateescape")
        yield trial(f"mtllib {name[:20]!r}", "a.obj", obj)


def not_files() -> Iterator[Trial]:
    """Yield what is no regular file, as a model and as a texture."""
    skinned = VERTEX_LINES + "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    kinds: dict[str, Callable[[Path], object]] = {
        "pipe": os.mkfifo,
        "endless": lambda at: at.symlink_to("/dev/zero"),
        "nothing": lambda at: at.symlink_to("/dev/null"),
        "circle": lambda at: at.symlink_to(at.name),
        "dangling": lambda at: at.symlink_to("nowhere"),
        "folder": Path.mkdir,
        "sparse": sparse,
    }
    for kind, make in kinds.items():
        for suffix in ("ply", "obj", "stl", "las", "laz", "glb", "xyz", "e57", "3mf"):
            if kind != "sparse":
                yield trial(f"a {kind} as a model", f"a.{suffix}", make)
        yield Trial("images as textures", {"a.obj": skinned.encode(), "skin.png": make}, "a.obj",
                    ("--no-cache", "--texture", "skin.png"), False, f"a {kind} that was asked for")  # fmt: skip
        files = {"a.obj": b"mtllib a.mtl\nusemtl a\n" + skinned.encode(), "a.mtl": b"newmtl a\nmap_Kd skin.png\n"}
        yield Trial(
            "images as textures",
            {**files, "skin.png": make},
            "a.obj",
            ("--no-cache",),
            False,
            f"a {kind} in the folder",
        )
    bombs = {"a program": b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\nshowpage\n",
             "cut off": picture("PNG")[:60]}  # fmt: skip
    for label, data in bombs.items():
        files = {"a.obj": b"mtllib a.mtl\nusemtl a\n" + skinned.encode(), "a.mtl": b"newmtl a\nmap_Kd skin.png\n"}
        yield Trial("images as textures", {**files, "skin.png": data}, "a.obj", ("--no-cache",), False, label)


def far_points() -> Iterator[Trial]:
    """Yield clouds of coordinates at the ends of what numbers can say."""
    for scale in (1e-320, 1e-300, 1e-45, 1e-38, 1e-20, 1e20, 1e35, 1e37, 1e38, 1e150, 1e300):
        with np.errstate(all="ignore"):
            rows = "".join(" ".join(f"{value:.17g}" for value in row) + "\n" for row in (POINTS * scale))
        yield trial(f"a cloud of size {scale:g}", "a.xyz", rows)
        corners = "".join(f"v {x * scale!r} {y * scale!r} {z * scale!r}\n" for x, y, z in POINTS[:8].tolist())
        yield trial(f"a mesh of size {scale:g}", "a.obj", corners + "f 1 2 3\nf 4 5 6\nf 6 7 8\nf 1 5 8\n")


def crowds() -> Iterator[Trial]:
    """Yield as many primitives as a megabyte holds, in places where each is near to all others; each is drawn, too."""
    rng = np.random.default_rng(4)
    corners = rng.uniform(-1.0, 1.0, (20_000, 3))
    turns = np.linspace(0.0, 6.0, 50_000)
    circle = np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=1)
    steps = np.arange(len(turns) - 1)
    shells = np.concatenate(
        [0.99**k * corners[:24] / np.linalg.norm(corners[:24], axis=1)[:, None] for k in range(800)]
    )
    hulls = 24 * np.arange(800)[:, None, None] + rng.integers(0, 24, (100, 3))
    meshes = {
        "needles": (corners, rng.integers(0, len(corners), (100_000, 3))),
        "triangles among sixty points": (corners[:60], rng.integers(0, 60, (140_000, 3))),
        "coincident triangles": (corners[:3], np.tile([0, 1, 2], (140_000, 1))),
        "a fan": (np.concatenate([np.zeros((1, 3)), circle]), np.stack([0 * steps, 1 + steps, 2 + steps], axis=1)),
        "shells in shells": (shells, hulls.reshape(-1, 3)),
    }
    for label, (positions, faces) in meshes.items():
        yield _crowd(label, binary_ply(positions, faces))
    clouds = {
        "points all over a cube": rng.uniform(-1.0, 1.0, (83_000, 3)),
        "equal points": np.zeros((83_000, 3)),
        "points on a line": np.linspace(0.0, 1.0, 83_000)[:, None] * [[1.0, 2.0, 3.0]],
        "clusters in clusters": np.cumprod(rng.uniform(0.0, 0.2, (83_000, 12, 3)), axis=1).sum(axis=1),
    }
    for label, positions in clouds.items():
        yield _crowd(label, binary_ply(positions))
    digits = "\n".join(" ".join(row) for row in rng.integers(0, 10, (166_000, 3)).astype(str))
    yield replace(trial("points on a grid, as text", "a.xyz", digits), picture=True)


def _crowd(label: str, data: bytes) -> Trial:
    assert len(data) < MEGABYTE
    return replace(trial(label, "a.ply", data), picture=True)


def binary_ply(positions: np.ndarray, faces: np.ndarray | None = None) -> bytes:
    """Return a PLY of points (V, 3), and faces (T, 3) if any, in as few bytes as there are."""
    lines = [f"element vertex {len(positions)}", *(f"property float {axis}" for axis in "xyz")]
    records = np.zeros(0 if faces is None else len(faces), np.dtype([("corners", "u1"), ("indices", "<u2", 3)]))
    if faces is not None:
        lines += [f"element face {len(faces)}", "property list uchar ushort vertex_indices"]
        records["corners"], records["indices"] = 3, faces
    return ply_header("binary_little_endian", *lines).encode() + positions.astype("<f4").tobytes() + records.tobytes()
