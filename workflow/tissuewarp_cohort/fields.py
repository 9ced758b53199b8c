"""Displacement fields and label maps of NIfTI as arrays, and points carried through them. Needs numpy."""

import gzip
import struct

import numpy

from .headers import nifti

TYPES = {2: "u1", 4: "<i2", 8: "<i4", 16: "<f4", 64: "<f8", 256: "i1", 512: "<u2", 768: "<u4"}


def read_nifti(path):
    """(array of x, y, z and components, matrix 4 x 4 from voxels to LPS mm) of a little-endian NIfTI-1 file."""
    grid = nifti(path)
    opened = gzip.open(path, "rb") if str(path).endswith(".gz") else open(path, "rb")
    with opened as file:
        data = file.read()
    if data[:4] != struct.pack("<i", 348):
        raise ValueError(f"'{path}' is no little-endian NIfTI-1")
    dimensions = struct.unpack_from("<8h", data, 40)
    shape = dimensions[1:1 + dimensions[0]]
    kind = numpy.dtype(TYPES[struct.unpack_from("<h", data, 70)[0]])
    start = int(struct.unpack_from("<f", data, 108)[0])
    values = numpy.frombuffer(data, kind, int(numpy.prod(shape)), start).reshape(shape, order="F")
    slope, intercept = struct.unpack_from("<2f", data, 112)
    if slope not in (0.0, 1.0) or intercept != 0.0:
        values = values * (slope or 1.0) + intercept
    matrix = numpy.eye(4)
    matrix[:3] = numpy.array(grid.columns).T
    return values.reshape(*grid.size, -1), numpy.diag([-1, -1, 1, 1]) @ matrix


def write_nifti(path, values, matrix_lps, vectors=False):
    """float32, or uint8 and int16 as they are; vectors as ANTs has them (five dimensions, intent 1007)."""
    codes = {"float32": (16, 32), "uint8": (2, 8), "int16": (4, 16)}
    if values.dtype.name not in codes:
        values = values.astype(numpy.float32)
    code, bits = codes[values.dtype.name]
    size, matrix = values.shape[:3], numpy.diag([-1, -1, 1, 1]) @ matrix_lps
    header = bytearray(352)
    struct.pack_into("<i", header, 0, 348)
    struct.pack_into("<8h", header, 40, 5 if vectors else 3, *size, 1, 3 if vectors else 1, 1, 1)
    struct.pack_into("<h", header, 68, 1007 if vectors else 0)
    struct.pack_into("<2h", header, 70, code, bits)
    struct.pack_into("<8f", header, 76, 1, *numpy.linalg.norm(matrix[:3, :3], axis=0), 1, 1, 1, 1)
    struct.pack_into("<3f", header, 108, 352, 1, 0)
    header[123] = 2  # mm
    struct.pack_into("<2h", header, 252, 0, 1)
    for row in range(3):
        struct.pack_into("<4f", header, 280 + 16 * row, *matrix[row])
    header[344:348] = b"n+1\0"
    with gzip.GzipFile(path, "wb", compresslevel=4, mtime=0) as file:
        file.write(bytes(header) + values.tobytes(order="F"))


def places_of(shape, matrix):
    """LPS mm of all voxel centres, n x 3, the first index fastest."""
    index = numpy.stack(numpy.meshgrid(*map(numpy.arange, shape[:3]), indexing="ij"), -1).reshape(-1, 3, order="F")
    return index @ matrix[:3, :3].T + matrix[:3, 3]


class Field:
    """x → x + u(x), LPS mm, trilinear between voxel centres; NaN where the field is not known."""

    def __init__(self, path):
        self.values, self.matrix = read_nifti(path)
        self.to_index = numpy.linalg.inv(self.matrix)

    def displacement(self, places):
        return sampled(self.values, places @ self.to_index[:3, :3].T + self.to_index[:3, 3])

    def __call__(self, places):
        return places + self.displacement(places)


def sampled(values, index):
    """Trilinear at fractional indices, n x 3; NaN beyond the outermost voxel centres."""
    last = numpy.array(values.shape[:3]) - 1
    inside = numpy.all((index >= 0) & (index <= last), axis=1)
    result = numpy.full((len(index), values.shape[3]), numpy.nan)
    at = index[inside]
    low = numpy.minimum(at.astype(int), numpy.maximum(last - 1, 0))
    part, total = at - low, 0.0
    for corner in range(8):
        step = numpy.array([corner & 1, corner >> 1 & 1, corner >> 2 & 1])
        weight = numpy.prod(numpy.where(step, part, 1 - part), axis=1)
        x, y, z = numpy.minimum(low + step, last).T
        total = total + weight[:, None] * values[x, y, z]
    result[inside] = total
    return result
