"""A worse intraoperative volume out of a good one: part of the head, thick slices, noise, another modality's contrast."""

import numpy
from scipy import ndimage

from . import fields, scoring

VIEW_SHARE = 1 / 3  # of the head's voxels
SLICE_VOXELS = 3  # along the last axis
NOISE_SHARE = 0.10  # of the brain's mean


def head(voxels):
    """Everything that is not air: more than a quarter of the mean of what is bright, smoothed; one piece, holes filled."""
    smooth = ndimage.gaussian_filter(voxels.astype(numpy.float32), 1.5)
    rough = smooth > smooth.mean()
    parts, _ = ndimage.label(smooth > 0.25 * smooth[rough].mean())
    return ndimage.binary_fill_holes(parts == numpy.argmax(numpy.bincount(parts.ravel())[1:]) + 1)


def view_around(tissue, affine, centre, share=VIEW_SHARE):
    """The ball about an LPS point that holds a share of the tissue's voxels."""
    grid = numpy.stack(numpy.meshgrid(*map(numpy.arange, tissue.shape), indexing="ij", sparse=False), axis=-1)
    distance = numpy.linalg.norm(grid @ affine[:3, :3].T.astype(numpy.float32) + (affine[:3, 3] - centre), axis=-1)
    return distance <= numpy.quantile(distance[tissue], share)


def other_contrast(voxels):
    """Tissue dark where it was bright and the other way round, not linearly; air stays dark. Values 0 to about 1000.

    y = 1000 (1 - x)^1.5 x^2 / (x^2 + 0.1^2), x the grey value over its 99.5th percentile, at most 1.
    """
    x = numpy.clip(voxels / numpy.percentile(voxels[voxels > 0], 99.5), 0.0, 1.0)
    return 1000.0 * (1.0 - x) ** 1.5 * x**2 / (x**2 + 0.01)


def thick_slices(voxels, affine, count=SLICE_VOXELS):
    """Means of `count` neighbours along the last axis, on the grid of the thick slices; an incomplete last one is left out."""
    slices = voxels.shape[2] // count
    thick = voxels[:, :, :slices * count].reshape(voxels.shape[:2] + (slices, count)).mean(axis=3)
    coarse = affine.copy()
    coarse[:3, 3] += affine[:3, 2] * (count - 1) / 2
    coarse[:3, 2] *= count
    return thick, coarse


def degrade(voxels, affine, brain, centre, seed=20):
    """The degraded volume, the mask of its view and their affine.

    voxels, brain: volume and brain mask on one grid with `affine` (index to LPS mm); centre: of the view, LPS mm.
    Contrast, thick slices, Rician noise of 10 % of the brain's mean, then zeros outside the view.
    """
    tissue = head(voxels)
    thick, coarse = thick_slices(other_contrast(voxels.astype(float)), affine)
    view = thick_slices(view_around(tissue, affine, centre).astype(float), affine)[0] > 0.5
    organ = thick_slices(brain.astype(float), affine)[0] > 0.5
    deviation = NOISE_SHARE * thick[organ].mean()
    noise = numpy.random.default_rng(seed).normal(0.0, deviation, (2,) + thick.shape)
    noisy = numpy.hypot(thick + noise[0], noise[1])
    return numpy.where(view, numpy.maximum(numpy.rint(noisy), 1.0), 0.0).astype(numpy.int16), view, coarse


def degrade_files(volume_path, labels_path, surface_path, image_path, view_path):
    """`degrade` from and to files; the view lies about the centroid of the exposed surface."""
    voxels, affine = fields.read_image(volume_path)
    labels, _ = fields.read_image(labels_path)
    image, view, coarse = degrade(voxels, affine, labels > 0, scoring.read_ply_points(surface_path).mean(axis=0))
    fields.write_image(view_path, view.astype(numpy.uint8), coarse)
    fields.write_image(image_path, image, coarse)
