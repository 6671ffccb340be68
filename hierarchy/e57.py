"""Read E57 files, the format in which laser scanners deliver: several scans, each with its own place in the world.

Based on: ASTM E2807-11, and the extension for surface normals of libe57.org. A reader of our own, because the C++
library crashes on damaged files, believes any count of points and drops normals and 16-bit colours in Python.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from hierarchy.e57_packets import Field, read_columns, section_length
from hierarchy.e57_pages import PagedFile
from hierarchy.model import BoolArray, Float64Array, Progress, UInt8Array, ignore_progress
from hierarchy.part import Part, UnreadableFile, colors_from_channels
from hierarchy.unpacking import check_unpacked

CARTESIAN = ("cartesianX", "cartesianY", "cartesianZ")
SPHERICAL = ("sphericalRange", "sphericalAzimuth", "sphericalElevation")
NORMAL = ("normalX", "normalY", "normalZ")
COLOR = ("colorRed", "colorGreen", "colorBlue")
STATES = ("cartesianInvalidState", "sphericalInvalidState", "isColorInvalid")
WANTED = {*CARTESIAN, *SPHERICAL, *NORMAL, *COLOR, *STATES, "intensity"}

Columns = dict[str, Float64Array]


def read_e57(path: Path, warnings: list[str], progress: Progress = ignore_progress) -> list[Part]:
    """Read every scan of a file as one part, placed by its pose; colours are its own, or else its intensity as grey.

    warnings : gets a sentence for the scans that have no coordinates
    Raises UnreadableFile, OSError, ValueError where the description holds no number in a number's place.
    """
    with path.open("rb") as stream:
        file = PagedFile(stream)
        scans = list(_scans(file.description()))
        check_unpacked(sum(_count(points) for _, points in scans), file.size)
        parts, bytes_left, without = [], file.size, 0
        for i, (scan, points) in enumerate(scans):
            progress("load", 0.3 * i / len(scans))
            fields = [_field(each) for each in _leaves(_child(points, "prototype"))]
            if not any(set(axes) <= {field.name for field in fields} for axes in (CARTESIAN, SPHERICAL)):
                without += 1
                continue
            if _count(points) == 0:
                continue
            start = int(points.get("fileOffset", "0"))
            # Many scans that share one section would make any work of a small file.
            bytes_left -= section_length(file, start)
            if bytes_left < 0:
                raise UnreadableFile("damaged: its scans overlap")
            columns = read_columns(file, start, _count(points), fields, WANTED)
            part = _part(columns, scan, {field.name: field for field in fields})
            if len(part.positions):
                parts.append(part)
    if without:
        warnings.append(f"left out {without} scan{'s' * (without != 1)} without coordinates")
    if not parts:
        raise UnreadableFile("nothing to draw: it holds no points")
    return parts


def _scans(description: str) -> Iterator[tuple[ET.Element, ET.Element]]:
    """Yield the description of each scan, and in it that of its points. Raises UnreadableFile."""
    # The format has no use for entities, which can make a line of text into gigabytes.
    if "<!DOCTYPE" in description:
        raise UnreadableFile("damaged: its description defines entities")
    try:
        root = ET.fromstring(description)
    except ET.ParseError as error:
        raise UnreadableFile(f"damaged: its description is no XML ({error})") from None
    data = _child(root, "data3D")
    for scan in data if data is not None else ():
        points = _child(scan, "points")
        if points is not None:
            yield scan, points


def _local(element: ET.Element) -> str:
    return element.tag.rsplit("}", 1)[-1]


def _child(element: ET.Element | None, name: str) -> ET.Element | None:
    for each in element if element is not None else ():
        if _local(each) == name:
            return each
    return None


def _number(element: ET.Element | None, name: str, default: float) -> float:
    """Return the number in a child; one without a text is 0, as the format has it."""
    child = _child(element, name)
    return default if child is None else float(child.text or 0.0)


def _count(points: ET.Element) -> int:
    count = int(points.get("recordCount", "0"))
    if count < 0:
        raise UnreadableFile("damaged: a scan has a negative number of points")
    return count


def _leaves(element: ET.Element | None) -> Iterator[ET.Element]:
    """Yield the fields of a prototype in the order of their streams; they may be nested."""
    for each in element.iter() if element is not None else ():
        if each.get("type") in ("Float", "Integer", "ScaledInteger", "String"):
            yield each


def _field(element: ET.Element) -> Field:
    name, kind = _local(element), element.get("type")
    if kind == "Float":
        return Field(name, 32 if element.get("precision") == "single" else 64, floating=True)
    if kind == "String":
        # Nothing here is one, and its stream is only passed over.
        return Field("", 0)
    low, high = int(element.get("minimum", -(2**63))), int(element.get("maximum", 2**63 - 1))
    if not -(2**63) <= low <= high < 2**63:
        raise UnreadableFile(f"damaged: {name} has no range")
    scale, offset = float(element.get("scale", 1.0)), float(element.get("offset", 0.0))
    return Field(name, (high - low).bit_length(), minimum=low, maximum=high, scale=scale, offset=offset)


def _part(columns: Columns, scan: ET.Element, fields: dict[str, Field]) -> Part:
    """Turn the columns of a scan into a part in file space, without the points that the scanner marked as invalid."""
    cartesian = set(CARTESIAN) <= columns.keys()
    positions = _stack(columns, CARTESIAN) if cartesian else _from_spherical(_stack(columns, SPHERICAL))
    state = columns.get("cartesianInvalidState" if cartesian else "sphericalInvalidState")
    # 1 is a direction without a distance, 2 is nothing at all.
    valid: BoolArray = np.ones(len(positions), bool) if state is None else state == 0.0
    rotation, translation = _pose(_child(scan, "pose"))
    part = Part(positions[valid] @ rotation.T + translation)
    if set(NORMAL) <= columns.keys():
        part.normals = _stack(columns, NORMAL)[valid] @ rotation.T
    colors = _colors(columns, scan, fields)
    part.colors = None if colors is None else colors[valid]
    return part


def _stack(columns: Columns, names: tuple[str, ...]) -> Float64Array:
    return np.stack([columns[name] for name in names], axis=1)


def _from_spherical(coordinates: Float64Array) -> Float64Array:
    """Return x, y, z of range, azimuth (from x towards y) and elevation (from the xy plane), in radians."""
    distance, azimuth, elevation = coordinates.T
    across = distance * np.cos(elevation)
    return np.stack([across * np.cos(azimuth), across * np.sin(azimuth), distance * np.sin(elevation)], axis=1)


def _pose(pose: ET.Element | None) -> tuple[Float64Array, Float64Array]:
    """Return the rotation (3, 3) and the translation (3,) that take a scan to file space.

    A quaternion that is none, zero or not finite, turns nothing.
    """
    rotation, translation = _child(pose, "rotation"), _child(pose, "translation")
    w, x, y, z = (_number(rotation, name, float(name == "w")) for name in "wxyz")
    length = np.sqrt(w * w + x * x + y * y + z * z)
    matrix = np.eye(3)
    if 0.0 < length < np.inf:
        w, x, y, z = (float(value / length) for value in (w, x, y, z))
        matrix = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
    return matrix, np.array([_number(translation, name, 0.0) for name in "xyz"])


def _colors(columns: Columns, scan: ET.Element, fields: dict[str, Field]) -> UInt8Array | None:
    """Return uint8 (N, 4): the colours, white where they are marked as invalid; or else the intensity as grey."""
    if set(COLOR) <= columns.keys():
        colors = _scaled(columns, COLOR, _child(scan, "colorLimits"), fields)
        if "isColorInvalid" in columns:
            colors[columns["isColorInvalid"] != 0.0] = 255
        return colors
    if "intensity" in columns:
        grey = _scaled(columns, ("intensity",), _child(scan, "intensityLimits"), fields)[:, 0]
        return np.stack([grey, grey, grey, np.full_like(grey, 255)], axis=1)
    return None


def _scaled(
    columns: Columns, names: tuple[str, ...], limits: ET.Element | None, fields: dict[str, Field]
) -> UInt8Array:
    """Return the named columns as uint8 (N, 4), scaled from the limits that the scan or else the fields state."""
    channels = []
    for name in names:
        field = fields[name]
        low, high = np.nan, np.nan
        if limits is not None:
            low, high = (_number(limits, f"{name}{end}", np.nan) for end in ("Minimum", "Maximum"))
        elif field.maximum is not None:
            low, high = (value * field.scale + field.offset for value in (field.minimum, field.maximum))
        if not low < high < np.inf:
            return colors_from_channels([columns[each] for each in names])
        channels.append(np.clip((columns[name] - low) / (high - low), 0.0, 1.0))
    return colors_from_channels(channels)
