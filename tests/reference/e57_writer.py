"""Write E57 files, bit by bit as the standard says, for tests of the reader."""

import struct

import numpy as np

CONTENT = 1020
NAMESPACES = (
    'xmlns="http://www.astm.org/COMMIT/E57/2010-e57-v1.0" xmlns:nor="http://www.libe57.org/E57_NOR_surface_normals.txt"'
)


def integer(values, low, high, **scaling):
    """Return a field of integers of the fewest bits that hold `low` to `high`, scaled where `scaling` says."""
    kind = "ScaledInteger" if scaling else "Integer"
    more = "".join(f' {name}="{value!r}"' for name, value in scaling.items())
    attributes = f'type="{kind}" minimum="{low}" maximum="{high}"{more}'
    return attributes, pack_bits(np.asarray(values, object) - low, (high - low).bit_length())


def single(values):
    return 'type="Float" precision="single"', np.asarray(values, "<f4").tobytes()


def double(values):
    return 'type="Float"', np.asarray(values, "<f8").tobytes()


def pack_bits(values, bits):
    whole = 0
    for i, value in enumerate(values):
        whole |= int(value) << (i * bits)
    return whole.to_bytes((len(values) * bits + 7) // 8, "little")


def scan(count, fields, more=""):
    """Return what `write_e57` takes: a count of points, {name: field} and XML about the scan."""
    return count, fields, more


def write_e57(path, scans, piece=100, extra="", description=None, stated=None, shared=False):
    """Write scans into a file.

    piece : bytes of each stream in a packet, odd so that values lie across packets
    extra : XML for the root
    description : replaces the XML, in which %d stands for the offset of the first scan's points
    shared : all scans refer to the points of the first
    stated : the count of points that the XML states, in place of the true one
    """
    content = bytearray(48)
    children, offsets = [], []
    for count, fields, more in scans:
        if shared and offsets:
            offsets.append(offsets[0])
        else:
            offsets.append(physical(len(content)))
            content += section(len(content), [stream for _, stream in fields.values()], piece)
        prototype = "".join(f"<{name} {attributes}/>" for name, (attributes, _) in fields.items())
        children.append(
            f'<vectorChild type="Structure">{more}<points type="CompressedVector" fileOffset="{offsets[-1]}" '
            f'recordCount="{count if stated is None else stated}"><prototype type="Structure">{prototype}</prototype>'
            '<codecs type="Vector" allowHeterogeneousChildren="1"/></points></vectorChild>'
        )
    xml = (
        f'<?xml version="1.0" encoding="UTF-8"?><e57Root type="Structure" {NAMESPACES}>'
        '<formatName type="String">ASTM E57 3D Imaging Data File</formatName><guid type="String">{1}</guid>'
        '<versionMajor type="Integer">1</versionMajor><versionMinor type="Integer">0</versionMinor>'
        f'<data3D type="Vector" allowHeterogeneousChildren="1">{"".join(children)}</data3D>{extra}</e57Root>'
    )
    if description is not None:
        xml = description % offsets[0]
    start = len(content)
    content += xml.encode()
    header = (b"ASTM-E57", 1, 0, -(-len(content) // CONTENT) * 1024, physical(start), len(xml.encode()), 1024)
    content[:48] = struct.pack("<8sIIQQQQ", *header)
    path.write_bytes(seal(bytes(content)))
    return path


def section(start, streams, piece):
    packets = bytearray()
    place = 0
    while place == 0 or place < max(map(len, streams)):
        pieces = [stream[place : place + piece] for stream in streams]
        body = struct.pack(f"<H{len(pieces)}H", len(pieces), *map(len, pieces)) + b"".join(pieces)
        body += bytes(-(4 + len(body)) % 4)
        packets += struct.pack("<BBH", 1, 0, 4 + len(body) - 1) + body
        # One to be passed over, as the standard allows.
        packets += struct.pack("<BBH", 2, 0, 8 - 1) + bytes(4)
        place += piece
    return struct.pack("<B7xQQQ", 1, 32 + len(packets), physical(start + 32), 0) + packets


def physical(logical):
    return logical // CONTENT * 1024 + logical % CONTENT


def seal(content):
    """Return content in pages with their checksums."""
    content += bytes(-len(content) % CONTENT)
    pages = (content[i : i + CONTENT] for i in range(0, len(content), CONTENT))
    return b"".join(page + crc32c(page).to_bytes(4, "big") for page in pages)


def reseal(data):
    """Return the bytes of a file with the checksums that its pages should have."""
    whole = len(data) // 1024 * 1024
    return seal(b"".join(data[i : i + CONTENT] for i in range(0, whole, 1024))) + data[whole:]


def _table():
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0x82F63B78 if value & 1 else 0)
        yield value


TABLE = list(_table())


def crc32c(data):
    value = 0xFFFFFFFF
    for byte in data:
        value = TABLE[(value ^ byte) & 0xFF] ^ value >> 8
    return value ^ 0xFFFFFFFF
