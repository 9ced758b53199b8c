"""Errors of displacement fields against targets whose true motion is known. All lengths mm, all points LPS."""

import numpy

from . import fields


def read_csv_landmarks(path):
    """Preoperative and intraoperative positions, n x 3 each."""
    rows = numpy.genfromtxt(path, delimiter=",", names=True)
    pick = lambda prefix: numpy.stack([rows[prefix + axis] for axis in "xyz"], axis=1)
    return pick("pre_"), pick("intra_")


def read_elastix_points(path):
    return numpy.loadtxt(path, skiprows=2)


def read_ply_points(path):
    """Vertices of a binary little-endian PLY whose vertices are floats and begin with x, y, z: n x 3."""
    data = path.read_bytes()
    header, _, body = data.partition(b"end_header\n")
    lines = header.decode("ascii").splitlines()
    if "format binary_little_endian 1.0" not in lines:
        raise ValueError(f"{path}: only binary little-endian PLY is read")
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    properties = [line.split()[1:] for line in lines if line.startswith("property")]
    if [name for _, name in properties[:3]] != ["x", "y", "z"] or any(kind != "float" for kind, _ in properties):
        raise ValueError(f"{path}: vertices must be floats that begin with x, y, z")
    return numpy.frombuffer(body, "<f4", count * len(properties)).reshape(count, -1)[:, :3].astype(float)


def truth_targets(truth_path, mask_path):
    """Grid points of a true forward field that lie in a preoperative mask, before and after."""
    truth, affine = fields.read_field(truth_path)
    points = fields.grid_points(truth.shape[:3], affine)
    kept = fields.inside(*fields.read_image(mask_path), points)
    return points[kept], points[kept] + truth.reshape(-1, 3)[kept]


def summary(errors):
    return dict(count=len(errors), mean=float(errors.mean()), median=float(numpy.median(errors)),
                p95=float(numpy.percentile(errors, 95)), maximum=float(errors.max()))


def distances(a, b):
    return numpy.linalg.norm(a - b, axis=1)


def score_backward(field, affine, moving, fixed):
    """Errors at preoperative targets of a field that maps fixed to moving: it is inverted at each target.

    Also the count of targets at which no inverse was found to 0.1 mm; their error is that of the nearest place found.
    """
    found, residual = fields.invert_at(field, affine, moving)
    return summary(distances(found, fixed)) | dict(not_inverted=int((residual > 0.1).sum()))
