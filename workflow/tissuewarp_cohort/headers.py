"""What a file's first bytes say: whether it is what its name says, and an image's grid. No voxel is read."""

import dataclasses
import gzip
import math
import os
import struct
import zlib

SAME_GRID_VOXELS = 1e-3  # as imaging::same_grid


class Unusable(Exception):
    """What is wrong with a file, and the remedy."""

    def __init__(self, what, remedy):
        super().__init__(what)
        self.what, self.remedy = what, remedy


@dataclasses.dataclass(frozen=True)
class Grid:
    size: tuple
    columns: tuple  # of the matrix from voxels to mm: three axes and the origin

    def voxels(self):
        return math.prod(self.size)

    def point(self, index):
        return tuple(sum(i * axis[k] for i, axis in zip(index, self.columns)) + self.columns[3][k] for k in range(3))

    def spacing(self):
        return tuple(math.sqrt(sum(x * x for x in axis)) for axis in self.columns[:3])


def same_grid(a, b):
    if a.size != b.size:
        return False
    corners = [[(corner >> k & 1) * (a.size[k] - 1) for k in range(3)] for corner in range(8)]
    least = min(a.spacing())
    return all(math.dist(a.point(corner), b.point(corner)) <= SAME_GRID_VOXELS * least for corner in corners)


def head_of(path, count):
    try:
        opened = gzip.open(path, "rb") if str(path).endswith(".gz") else open(path, "rb")
        with opened as file:
            return file.read(count)
    except (OSError, EOFError, zlib.error) as failure:
        why = getattr(failure, "strerror", None) or str(failure)
        raise Unusable(f"cannot be read ({why})", "copy the file again") from failure


def checked(grid):
    if any(n < 1 for n in grid.size):
        raise Unusable(f"states a size of {grid.size} voxels", "give an image of three dimensions")
    if not all(math.isfinite(x) for axis in grid.columns for x in axis) or min(grid.spacing()) <= 0:
        raise Unusable("states voxels without a size", "correct the voxel size in its header")
    return grid


def quaternion_columns(b, c, d, pixdim, offset):
    a = math.sqrt(max(0.0, 1.0 - b * b - c * c - d * d))
    sign = -1.0 if pixdim[0] < 0 else 1.0
    axes = ((a * a + b * b - c * c - d * d, 2 * (b * c + a * d), 2 * (b * d - a * c)),
            (2 * (b * c - a * d), a * a + c * c - b * b - d * d, 2 * (c * d + a * b)),
            (2 * (b * d + a * c), 2 * (c * d - a * b), a * a + d * d - b * b - c * c))
    steps = (pixdim[1], pixdim[2], sign * pixdim[3])
    return (*(tuple(x * step for x in axis) for axis, step in zip(axes, steps)), offset)


def nifti(path):
    head = head_of(path, 540)
    order = {348: "<", 0x5C010000: ">", 540: "<", 0x1C020000: ">"}.get(int.from_bytes(head[:4], "little"))
    if order is None or len(head) < 348:
        raise Unusable("begins with no header of NIfTI", "give a NIfTI image")
    second = struct.unpack_from(order + "i", head)[0] == 540
    if second and len(head) < 540:
        raise Unusable("ends within its header", "copy the file again")
    size = struct.unpack_from(order + ("8q" if second else "8h"), head, 16 if second else 40)
    bits = struct.unpack_from(order + "h", head, 14 if second else 72)[0]
    pixdim = struct.unpack_from(order + ("8d" if second else "8f"), head, 104 if second else 76)
    start = struct.unpack_from(order + ("q" if second else "f"), head, 168 if second else 108)[0]
    codes = struct.unpack_from(order + ("2i" if second else "2h"), head, 344 if second else 252)
    numbers = struct.unpack_from(order + ("18d" if second else "18f"), head, 352 if second else 256)
    if not 3 <= size[0] <= 5 or any(n > 1 for n in size[4:1 + size[0]] if size[0] == 4):
        raise Unusable(f"has {size[0]} dimensions of {size[1:1 + max(0, min(size[0], 7))]}", "give one volume")
    if codes == (0, 0):
        raise Unusable("does not say where it lies (neither qform nor sform is set)", "write its place into its header")
    check_length(path, int(start), math.prod(size[1:1 + size[0]]) * bits // 8, head)
    rows = [numbers[6 + 4 * row:10 + 4 * row] for row in range(3)]
    sform = tuple(tuple(row[k] for row in rows) for k in range(4))
    qform = quaternion_columns(*numbers[:3], pixdim, numbers[3:6])
    takes_sform = codes[0] <= 0 or codes[1] == 1
    return checked(Grid(tuple(size[1:4]), sform if takes_sform else qform))


def check_length(path, start, bytes_of_voxels, head):
    """Of files that are not packed: whether all voxels are there."""
    single = head[344:347] == b"n+1" or head[4:7] == b"n+2"
    if not str(path).endswith(".gz") and single and os.path.getsize(path) < start + bytes_of_voxels:
        raise Unusable(f"ends after {os.path.getsize(path)} of {start + bytes_of_voxels} bytes", "copy the file again")


def text_header(path, end):
    """{key: value} of `key = value` or `key: value` lines."""
    text = head_of(path, 1 << 16).decode("latin-1")
    fields = {}
    for line in text.splitlines():
        if not line.strip():
            break
        key, _, value = line.partition("=" if end == "meta" else ":")
        fields[key.strip().lower()] = value.strip()
        if end == "meta" and key.strip().lower() == "elementdatafile":
            break
    return text, fields


def numbers_in(text, count, what):
    try:
        values = [float(word) for word in text.replace("(", " ").replace(")", " ").replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != count:
        raise Unusable(f"states '{text}' for {what}", "correct its header")
    return values


def meta_image(path):
    text, fields = text_header(path, "meta")
    if "ndims" not in fields or "dimsize" not in fields:
        raise Unusable("begins with no header of MetaImage", "give a MetaImage")
    if fields["ndims"] != "3":
        raise Unusable(f"has {fields['ndims']} dimensions", "give one volume")
    size = numbers_in(fields["dimsize"], 3, "DimSize")
    step = numbers_in(fields.get("elementspacing", fields.get("elementsize", "1 1 1")), 3, "ElementSpacing")
    origin = numbers_in(fields.get("offset", fields.get("position", fields.get("origin", "0 0 0"))), 3, "Offset")
    turn = numbers_in(fields.get("transformmatrix", "1 0 0 0 1 0 0 0 1"), 9, "TransformMatrix")
    require_beside(path, fields.get("elementdatafile", "LOCAL"), ("LOCAL",))
    axes = tuple(tuple(step[k] * turn[3 * k + i] for i in range(3)) for k in range(3))
    return checked(Grid(tuple(int(n) for n in size), (*axes, tuple(origin))))


def require_beside(path, name, inside):
    if name and name not in inside and "%" not in name and not name.startswith("LIST"):
        if not os.path.exists(os.path.join(os.path.dirname(path), name)):
            raise Unusable(f"keeps its voxels in '{name}', which is not there", "copy both files")


def nrrd(path):
    text, fields = text_header(path, "nrrd")
    if not text.startswith("NRRD"):
        raise Unusable("begins with no header of NRRD", "give a NRRD image")
    require_beside(path, fields.get("data file", fields.get("datafile", "")), ())
    if fields.get("dimension") != "3" or "space directions" not in fields:
        return None  # layers of a segmentation, or headers that register judges
    size = numbers_in(fields.get("sizes", ""), 3, "sizes")
    turn = numbers_in(fields["space directions"], 9, "space directions")
    origin = numbers_in(fields.get("space origin", "0 0 0"), 3, "space origin")
    axes = tuple(tuple(turn[3 * k:3 * k + 3]) for k in range(3))
    return checked(Grid(tuple(int(n) for n in size), (*axes, tuple(origin))))


def dicom(path):
    if os.path.isdir(path):
        if not any(entry.is_file() for entry in os.scandir(path)):
            raise Unusable("is a folder without files", "give the folder of one series")
    elif head_of(path, 132)[128:] != b"DICM":
        raise Unusable("is no DICOM file", "give a DICOM file or the folder of one series")
    return None


BEGINNINGS = {".ply": b"ply", ".vtk": b"# vtk", ".vtp": b"<", ".vtu": b"<", ".msh": b"$MeshFormat", ".json": b"{",
              ".h5": b"\x89HDF", ".fcsv": b"#"}


def any_other(path):
    head = head_of(path, 64)
    if not head:
        raise Unusable("is empty", "copy the file again")
    begins = BEGINNINGS.get(os.path.splitext(path)[1].lower())
    if begins and not head.lstrip(b"\xef\xbb\xbf \r\n\t").startswith(begins):
        raise Unusable(f"does not begin as a file of its kind does ('{begins.decode('latin-1')}')",
                       "give a file of the kind that its name says")
    return None


def grid_of(path):
    """The grid of an image, None of what is no image or says it elsewhere. Throws Unusable."""
    name = os.path.basename(path).lower()
    if os.path.isdir(path) or name.endswith((".dcm", ".ima")):
        return dicom(path)
    if name.endswith((".nii", ".nii.gz")):
        return nifti(path)
    if name.endswith((".mha", ".mhd")):
        return meta_image(path)
    if name.endswith((".nrrd", ".nhdr")):
        return nrrd(path)
    return any_other(path)
