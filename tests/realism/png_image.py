# SPDX-License-Identifier: Apache-2.0
"""PNG files with 8 bits a channel as NumPy arrays: what the comparison of pictures needs, without a library for images."""

import struct
import zlib

import numpy

SIGNATURE = b"\x89PNG\r\n\x1a\n"
CHANNELS = {0: 1, 2: 3, 4: 2, 6: 4}  # of a colour type


def _chunks(content):
    at = len(SIGNATURE)
    while at < len(content):
        length, kind = struct.unpack(">I4s", content[at : at + 8])
        yield kind, content[at + 8 : at + 8 + length]
        at += length + 12


def _paeth(left, up, corner):
    to_left, to_up = abs(up - corner), abs(left - corner)
    to_corner = abs(left + up - 2 * corner)
    if to_left <= to_up and to_left <= to_corner:
        return left
    return up if to_up <= to_corner else corner


def _unfilter(kind, row, above, step):
    """The bytes of a row from those that were stored; `step`: bytes of a pixel."""
    if kind == 0:
        return row
    if kind == 2:
        return row + above
    if kind == 1:  # each channel is a running sum
        return numpy.cumsum(row.reshape(-1, step), axis=0, dtype=numpy.uint8).reshape(-1)
    result, stored, up = [0] * len(row), row.tolist(), above.tolist()
    for i, value in enumerate(stored):
        left, corner = (result[i - step], up[i - step]) if i >= step else (0, 0)
        result[i] = (value + ((left + up[i]) // 2 if kind == 3 else _paeth(left, up[i], corner))) & 255
    return numpy.array(result, dtype=numpy.uint8)


def read(path):
    """Height x width x channels, bytes. Raises ValueError for what is not such a PNG file."""
    with open(path, "rb") as file:
        content = file.read()
    if not content.startswith(SIGNATURE):
        raise ValueError(f"{path}: not a PNG file")
    header, data = None, b""
    for kind, body in _chunks(content):
        if kind == b"IHDR":
            header = struct.unpack(">IIBBBBB", body)
        elif kind == b"IDAT":
            data += body
    width, height, depth, colour, _, _, interlaced = header
    if depth != 8 or colour not in CHANNELS or interlaced:
        raise ValueError(f"{path}: expected 8 bits a channel, no palette, not interlaced")
    step = CHANNELS[colour]
    lines = numpy.frombuffer(zlib.decompress(data), dtype=numpy.uint8).reshape(height, 1 + step * width)
    rows = numpy.zeros((height + 1, step * width), dtype=numpy.uint8)
    for y in range(height):
        rows[y + 1] = _unfilter(lines[y, 0], lines[y, 1:], rows[y], step)
    return rows[1:].reshape(height, width, step)


def write(path, pixels):
    """`pixels`: height x width x 3, bytes."""
    height, width, _ = pixels.shape

    def chunk(kind, body):
        return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))

    lines = b"".join(b"\0" + row.tobytes() for row in pixels)
    with open(path, "wb") as file:
        file.write(SIGNATURE + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)))
        file.write(chunk(b"IDAT", zlib.compress(lines, 9)) + chunk(b"IEND", b""))
