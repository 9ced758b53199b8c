"""Rules that several sets share. Points and fields are LPS mm; fields are NIfTI as tissuewarp writes them."""

import nibabel
import numpy

from tissuewarp_cohort.fields import Field, places_of

FLIP = numpy.diag([-1.0, -1.0, 1.0, 1.0])
FIXED_TO_MOVING, MOVING_TO_FIXED = "displacement_fixed_to_moving.nii.gz", "displacement_moving_to_fixed.nii.gz"


def load(path):
    """(array, matrix 4 x 4 from voxels to LPS mm)"""
    image = nibabel.load(str(path))
    return numpy.asanyarray(image.dataobj), FLIP @ image.affine


def save(path, values, matrix):
    image = nibabel.Nifti1Image(values, FLIP @ matrix)
    image.header.set_xyzt_units("mm")
    image.set_qform(FLIP @ matrix, 1)
    image.set_sform(FLIP @ matrix, 1)
    nibabel.save(image, str(path))
    return path


def to_places(indices, matrix):
    return numpy.asarray(indices, float) @ matrix[:3, :3].T + matrix[:3, 3]


def write_landmarks(path, moving, fixed):
    numpy.savetxt(path, numpy.hstack([moving, fixed]), delimiter=",", fmt="%.5f", comments="",
                  header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")
    return path


def errors(field, start, end):
    """(before, after): distances of start and of where the field carries it to end. Outside the field it stays."""
    moved = Field(str(field))(start)
    moved = numpy.where(numpy.isfinite(moved), moved, start)
    return numpy.linalg.norm(start - end, axis=1), numpy.linalg.norm(moved - end, axis=1)


def warped(values, matrix, field):
    """Labels on the field's grid, nearest neighbour."""
    places = places_of(field.values.shape, field.matrix)
    to_index = numpy.linalg.inv(matrix)
    index = numpy.rint(field(places) @ to_index[:3, :3].T + to_index[:3, 3])
    inside = numpy.all((index >= 0) & (index < values.shape[:3]), axis=1)
    result = numpy.zeros(len(places), values.dtype)
    result[inside] = values[tuple(index[inside].astype(int).T)]
    return result.reshape(field.values.shape[:3], order="F")


def dice(a, b):
    total = a.sum() + b.sum()
    return 2 * numpy.logical_and(a, b).sum() / total if total else float("nan")


def determinants(field):
    """det J of x + u(x) at inner voxels, central differences."""
    spacing = numpy.linalg.norm(field.matrix[:3, :3], axis=0)
    axes = field.matrix[:3, :3] / spacing
    local = field.values.astype(float) @ axes  # components along the grid's axes
    gradient = numpy.stack([numpy.stack(numpy.gradient(local[..., k], *spacing), -1) for k in range(3)], -2)
    return numpy.linalg.det(gradient + numpy.eye(3))[1:-1, 1:-1, 1:-1]


def sd_log_j(field):
    """Standard deviation of log det J, what folds taken as 1e-9."""
    return float(numpy.log(numpy.clip(determinants(field), 1e-9, 1e9)).std())


def means(scores):
    """Mean of every measure over the cases that have it."""
    names = sorted({name for score in scores for name in score})
    return {name: float(numpy.nanmean([score[name] for score in scores if name in score])) for name in names}
