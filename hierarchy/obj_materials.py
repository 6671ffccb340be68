"""Read the material files of OBJ: of each material its colour and its colour texture."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from hierarchy.part import UnreadableFile
from hierarchy.references import inside_folder

# Options of a texture statement and how many values follow at most; those of variable number hold only numbers.
OPTIONS = {
    "-blendu": 1, "-blendv": 1, "-boost": 1, "-bm": 1, "-cc": 1, "-clamp": 1, "-imfchan": 1, "-mm": 2,
    "-o": 3, "-s": 3, "-t": 3, "-texres": 1, "-type": 1,
}  # fmt: skip
VARIABLE_OPTIONS = ("-o", "-s", "-t")


# Bytes; thousands of materials take some hundreds of kilobytes.
LARGEST_FILE = 4 << 20


@dataclass(frozen=True)
class Material:
    """The diffuse colour, RGBA 0 to 255, and the name of the diffuse texture; None where the material has none."""

    color: tuple[int, int, int, int] | None = None
    texture_name: str | None = None


def read_materials(folder: Path, name: str) -> dict[str, Material]:
    """Read a material file by the name that an OBJ in `folder` gives it.

    Raises OSError where it is missing, UnreadableFile where it is too large.
    """
    with inside_folder(folder, name).open("rb") as stream:
        data = stream.read(LARGEST_FILE + 1)
    if len(data) > LARGEST_FILE:
        raise UnreadableFile("too large")
    text = data.decode("utf-8", "replace")
    materials: dict[str, Material] = {}
    current: str | None = None
    for line in text.splitlines():
        keyword, _, rest = line.strip().partition(" ")
        keyword, rest = keyword.lower(), rest.strip()
        if keyword == "newmtl":
            current = rest
            materials[current] = Material()
        elif current is not None and keyword == "kd":
            materials[current] = Material(_color(rest), materials[current].texture_name)
        elif current is not None and keyword == "map_kd":
            materials[current] = Material(materials[current].color, _texture_name(rest))
    return materials


def _color(values: str) -> tuple[int, int, int, int] | None:
    try:
        red, green, blue = (round(255 * min(max(float(value), 0.0), 1.0)) for value in values.split()[:3])
    except ValueError:
        return None
    return red, green, blue, 255


def _texture_name(rest: str) -> str | None:
    """Return the file name of a texture statement, which may hold blanks, without the options before it."""
    words = rest.split()
    while words and words[0] in OPTIONS:
        option = words.pop(0)
        for _ in range(OPTIONS[option]):
            if words and (option not in VARIABLE_OPTIONS or _is_number(words[0])):
                words.pop(0)
    return " ".join(words) or None


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
