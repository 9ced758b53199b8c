"""Pictures of slices for the documents, without a library that draws: grey values in, PNG out."""

import struct
import zlib

import numpy


def enlarged(values, pixels):
    """Grey values of a slice, 0 to 255, each of them a square of so many pixels."""
    return numpy.kron(numpy.clip(values, 0, 255), numpy.ones((pixels, pixels))).astype(numpy.uint8)


def write_png(path, grey_values):
    """Rows of grey values (uint8)."""
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    height, width = grey_values.shape
    rows = b"".join(b"\0" + row.tobytes() for row in grey_values)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)) +
                     chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b""))
