"""The data of a PLY file: every element becomes flat columns, whatever mixture of lists it holds.

Rows whose lists all have the first row's lengths (the common case) are read as one table with a stride; others are
walked once by compiled code that notes where each list lies, and gathered.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from hierarchy.part import AnyArray, Int64Array, UnreadableFile
from hierarchy.ply_header import Element, Header, Property


@dataclass(eq=False)
class Table:
    """One element's data.

    columns : scalar property -> (rows,)
    lists : list property -> counts int64 (rows,) and the items of all rows one after another
    """

    columns: dict[str, AnyArray] = field(default_factory=dict)
    lists: dict[str, tuple[Int64Array, AnyArray]] = field(default_factory=dict)


def read_body(data: bytes, header: Header) -> dict[str, Table]:
    """Read every element after the header of `data`. Raises UnreadableFile where the data end too early."""
    if header.ascii:
        return _read_ascii(data[header.size :], header)
    raw = np.frombuffer(data, np.uint8)
    tables: dict[str, Table] = {}
    offset = header.size
    for element in header.elements:
        _check_room(element, sum(p.smallest_size for p in element.properties), len(raw) - offset)
        tables[element.name], offset = _read_binary(raw, offset, element)
    return tables


def _check_room(element: Element, row_size: int, room: int) -> None:
    """Refuse an element that cannot fit into the rest of the file, before anything is allocated for it."""
    if element.count * row_size > room:
        raise UnreadableFile(
            f"truncated: its header promises {element.count} of element {element.name!r}, the file holds fewer"
        )


def _read_binary(raw: npt.NDArray[np.uint8], offset: int, element: Element) -> tuple[Table, int]:
    """Read one binary element that starts at byte `offset`; return it and the byte after it."""
    if element.count == 0 or not element.properties:
        return _empty_table(element), offset
    record = _record_like_first_row(raw, offset, element)
    if record is not None and offset + element.count * record.itemsize <= len(raw):
        rows = np.frombuffer(raw.data, record, element.count, offset)
        lists = [p for p in element.properties if p.count_type is not None]
        lengths = [record[f"items of {p.name}"].shape[0] if p.count_type is not None else 0 for p in element.properties]
        if all((rows[f"count of {p.name}"] == rows[f"count of {p.name}"][0]).all() for p in lists):
            table = Table()
            for p, length in zip(element.properties, lengths, strict=True):
                if p.count_type is None:
                    table.columns[p.name] = rows[p.name]
                else:
                    counts = np.full(element.count, length, np.int64)
                    table.lists[p.name] = counts, rows[f"items of {p.name}"].reshape(-1)
            return table, offset + element.count * record.itemsize
    return _walk_binary(raw, offset, element)


def _record_like_first_row(raw: npt.NDArray[np.uint8], offset: int, element: Element) -> np.dtype[np.void] | None:
    """Return the record type of the first row, or None where that row already ends beyond the file."""
    fields: list[tuple[str, np.dtype[np.generic]] | tuple[str, np.dtype[np.generic], tuple[int]]] = []
    for p in element.properties:
        if p.count_type is None:
            fields.append((p.name, p.type))
            offset += p.type.itemsize
            continue
        if offset + p.count_type.itemsize > len(raw):
            return None
        count = int(np.frombuffer(raw.data, p.count_type, 1, offset)[0])
        if count < 0 or count * p.type.itemsize > len(raw) - offset:
            return None
        fields += [(f"count of {p.name}", p.count_type), (f"items of {p.name}", p.type, (count,))]
        offset += p.count_type.itemsize + count * p.type.itemsize
    try:
        return np.dtype(fields)
    except ValueError:
        raise UnreadableFile(f"element {element.name!r} has two properties of one name") from None


def _walk_binary(raw: npt.NDArray[np.uint8], offset: int, element: Element) -> tuple[Table, int]:
    """Read one binary element whose rows differ in length."""
    from hierarchy.ply_walk import gather_bytes, walk_rows

    for p in element.properties:
        if p.count_type is not None and p.count_type.kind == "f":
            raise UnreadableFile(f"the list {p.name!r} counts its items in floating point")
    sizes = np.array([p.type.itemsize for p in element.properties], np.int64)
    count_sizes = np.array([0 if p.count_type is None else p.count_type.itemsize for p in element.properties], np.int64)
    big_endian = any(p.count_type is not None and p.count_type.newbyteorder(">") == p.count_type
                     and p.count_type.itemsize > 1 for p in element.properties)  # fmt: skip
    starts, counts, end = walk_rows(raw, offset, element.count, sizes, count_sizes, big_endian)
    if end < 0:
        raise UnreadableFile(f"truncated or damaged: element {element.name!r} runs beyond the end of the file")
    table = Table()
    for k, p in enumerate(element.properties):
        items = gather_bytes(raw, starts[k], counts[k], p.type.itemsize).view(p.type)
        if p.count_type is None:
            table.columns[p.name] = items
        else:
            table.lists[p.name] = counts[k], items
    return table, end


def _read_ascii(text: bytes, header: Header) -> dict[str, Table]:
    """Read every element of an ascii file."""
    # A value takes at least a digit and a blank.
    for element in header.elements:
        _check_room(element, 2 * len(element.properties), len(text) + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)
        try:
            values = np.fromstring(text, np.float64, sep=" ") if text.strip() else np.empty(0)
        except (DeprecationWarning, ValueError):
            raise UnreadableFile("damaged: its ascii data hold something that is not a number") from None
    tables: dict[str, Table] = {}
    offset = 0
    for element in header.elements:
        _check_room(element, len(element.properties), len(values) - offset)
        tables[element.name], offset = _read_values(values, offset, element)
    return tables


def _read_values(values: npt.NDArray[np.float64], offset: int, element: Element) -> tuple[Table, int]:
    """Read one ascii element that starts at value `offset`; return it and the value after it."""
    from hierarchy.ply_walk import walk_values

    if element.count == 0 or not element.properties:
        return _empty_table(element), offset
    table = Table()
    if all(p.count_type is None for p in element.properties):
        end = offset + element.count * len(element.properties)
        rows = values[offset:end].reshape(element.count, -1)
        for k, p in enumerate(element.properties):
            table.columns[p.name] = _typed(rows[:, k], p)
        return table, end
    is_list = np.array([p.count_type is not None for p in element.properties])
    starts, counts, end = walk_values(values, offset, element.count, is_list)
    if end < 0:
        raise UnreadableFile(f"truncated or damaged: element {element.name!r} runs beyond the end of the file")
    for k, p in enumerate(element.properties):
        if p.count_type is None:
            table.columns[p.name] = _typed(values[starts[k]], p)
        else:
            first = np.cumsum(counts[k]) - counts[k]
            places = np.arange(counts[k].sum()) + np.repeat(starts[k] - first, counts[k])
            table.lists[p.name] = counts[k], _typed(values[places], p)
    return table, end


def _typed(values: npt.NDArray[np.float64], prop: Property) -> AnyArray:
    """Tell integers from floats, as the colours' scale depends on it; values are kept in wide types."""
    if prop.type.kind == "f":
        return values
    bounded = np.clip(np.nan_to_num(values, nan=-1.0), -(2.0**62), 2.0**62)
    return bounded.astype(np.int64)


def _empty_table(element: Element) -> Table:
    table = Table()
    for p in element.properties:
        if p.count_type is None:
            table.columns[p.name] = np.empty(0, p.type)
        else:
            table.lists[p.name] = np.empty(0, np.int64), np.empty(0, p.type)
    return table
