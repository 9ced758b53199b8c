"""A small picture of a pair: the slice of the warped image where the error is expected to be largest, tissue that may
lie far off in red. Standard library alone."""

import gzip
import math
import os
import struct
import zlib

from .digests import read_json
from .headers import Unusable, nifti

SIDE = 96  # pixels
WORST_MM = 5.0  # this expected error, 1 σ, is full red
FORMATS = {2: "B", 4: "h", 8: "i", 16: "f", 64: "d", 256: "b", 512: "H", 768: "I"}


class Slices:
    """Axial slices of a packed NIfTI-1 volume, little endian as the program writes them."""

    def __init__(self, path):
        self.grid = nifti(path)
        with gzip.open(path, "rb") as file:
            self.bytes = file.read()
        self.code = FORMATS[struct.unpack_from("<h", self.bytes, 70)[0]]
        self.start = int(struct.unpack_from("<f", self.bytes, 108)[0])

    def rows(self, k, columns, lines):
        x, y, _ = self.grid.size
        values = memoryview(self.bytes)[self.start + k * x * y * struct.calcsize(self.code):]
        values = values[:x * y * struct.calcsize(self.code)].cast(self.code)
        return [[values[j * x + i] for i in columns] for j in lines]


def nearest_slice(grid, place_lps):
    """Of the place in LPS mm; the middle where there is none."""
    if not place_lps:
        return grid.size[2] // 2
    target = (-place_lps[0], -place_lps[1], place_lps[2])
    axis = grid.columns[2]
    length = sum(a * a for a in axis)
    middle = grid.point((grid.size[0] / 2, grid.size[1] / 2, 0))
    k = sum((t - m) * a for t, m, a in zip(target, middle, axis)) / length
    return min(grid.size[2] - 1, max(0, round(k)))


def place_in_fixed(report):
    """Of the worst expected error, LPS mm, carried by the rigid placement alone; None where no error was estimated."""
    place = report.get("error_estimate", {}).get("worst_place_mm")  # moving frame
    matrix = report.get("alignment", {}).get("matrix")
    if not place or not matrix:
        return place
    return [sum(row[k] * place[k] for k in range(3)) + row[3] for row in matrix[:3]]


def slice_with_tissue(slices, k, columns, lines):
    """The one nearest to k of which a hundredth or more is tissue: where values are finite and not 0."""
    least, count = 0.01 * len(columns) * len(lines), slices.grid.size[2]
    for away in range(count):
        for place in {k - away, k + away}:
            if 0 <= place < count:
                rows = slices.rows(place, columns, lines)
                if sum(math.isfinite(value) and value != 0 for row in rows for value in row) >= least:
                    return place
    return k


def grey_of(rows):
    flat = sorted(value for row in rows for value in row if math.isfinite(value))
    low, high = (flat[0], flat[min(len(flat) - 1, int(0.995 * len(flat)))]) if flat else (0, 1)
    scale = 255 / (high - low) if high > low else 0
    return [[max(0, min(255, int((value - low) * scale))) if math.isfinite(value) else 0 for value in row] for row in rows]


def png(pixels):
    """Rows of (red, green, blue)."""
    raw = b"".join(b"\0" + bytes(channel for pixel in row for channel in pixel) for row in pixels)

    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))

    header = struct.pack(">IIBBBBB", len(pixels[0]), len(pixels), 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9)) + chunk(b"IEND", b"")


def picture(folder):
    base = next((path for path in (os.path.join(folder, name) for name in ("warped.nii.gz", "warped_labels.nii.gz"))
                 if os.path.exists(path)), None)
    if base is None:
        return None
    image, report = Slices(base), read_json(os.path.join(folder, "report.json")) or {}
    size = image.grid.size
    step = max(1, math.ceil(max(size[:2]) / SIDE))
    columns, lines = range(0, size[0], step), list(reversed(range(0, size[1], step)))
    path = os.path.join(folder, "uncertainty.nii.gz")
    uncertainty = Slices(path) if os.path.exists(path) else None
    if uncertainty and uncertainty.grid.size != size:
        uncertainty = None
    k = slice_with_tissue(uncertainty or image, nearest_slice(image.grid, place_in_fixed(report)), columns, lines)
    grey = grey_of(image.rows(k, columns, lines))
    errors = uncertainty.rows(k, columns, lines) if uncertainty else None

    def pixel(j, i):
        share = min(1.0, errors[j][i] / WORST_MM) if errors and math.isfinite(errors[j][i]) else 0.0
        value = grey[j][i]
        return int(value + (255 - value) * share * 0.8), int(value * (1 - share * 0.8)), int(value * (1 - share * 0.8))

    return png([[pixel(j, i) for i in range(len(grey[0]))] for j in range(len(grey))])


def write(folder):
    """Writes thumbnail.png; a result that has no image, or one of another kind, has none."""
    try:
        data = picture(folder)
    except (Unusable, KeyError, ValueError, OSError, struct.error):
        return
    if data:
        with open(os.path.join(folder, "thumbnail.png"), "wb") as file:
            file.write(data)
