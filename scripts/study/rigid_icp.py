#!/usr/bin/python3
"""Rigid iterative closest point (Besl and McKay 1992, trimmed): the baseline of registration to a partial surface.

    rigid_icp.py SURFACE.ply LABELS LIKE FIELD.nii.gz

Brings the intraoperative points of SURFACE onto the surface of the organ (all labels of the preoperative map LABELS) and
writes the displacement from fixed to moving on the grid of the image LIKE, LPS mm.
"""

import pathlib
import sys

import numpy
from scipy import ndimage, spatial

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
from study import fields, scoring

KEPT = 0.9  # of the points; the worst tenth of each round is taken for outliers


def organ_surface(labels, affine):
    """Points on the boundary of the labelled region, LPS mm: boundary voxels moved to the half level of the smoothed mask."""
    organ = numpy.pad(labels > 0, 3)
    level = ndimage.gaussian_filter(organ.astype(numpy.float32), 1.0)
    index = numpy.argwhere(organ & ~ndimage.binary_erosion(organ)).astype(float)
    slope = numpy.gradient(level)
    for _ in range(3):
        value = ndimage.map_coordinates(level, index.T, order=1) - 0.5
        gradient = numpy.stack([ndimage.map_coordinates(part, index.T, order=1) for part in slope], axis=1)
        step = -value[:, None] * gradient / numpy.maximum((gradient**2).sum(axis=1), 1e-4)[:, None]
        index += numpy.clip(step, -1.0, 1.0)
    return fields.to_points(affine, index - 3)


def rigid_fit(source, target):
    """Rotation and translation of least squares (Kabsch 1976)."""
    centre, goal = source.mean(axis=0), target.mean(axis=0)
    u, _, vt = numpy.linalg.svd((source - centre).T @ (target - goal))
    rotation = vt.T @ numpy.diag([1.0, 1.0, numpy.sign(numpy.linalg.det(vt.T @ u.T))]) @ u.T
    return rotation, goal - rotation @ centre


def icp(points, surface, rounds=200):
    """Rotation and translation that carry intraoperative points onto the preoperative surface."""
    tree = spatial.cKDTree(surface)
    rotation, translation, former = numpy.eye(3), numpy.zeros(3), numpy.inf
    for _ in range(rounds):
        distance, nearest = tree.query(points @ rotation.T + translation)
        kept = distance <= numpy.quantile(distance, KEPT)
        rotation, translation = rigid_fit(points[kept], surface[nearest[kept]])
        error = distance[kept].mean()
        if former - error < 1e-5:
            break
        former = error
    return rotation, translation


def main():
    surface, labels, like, output = map(pathlib.Path, sys.argv[1:])
    rotation, translation = icp(scoring.read_ply_points(surface), organ_surface(*fields.read_image(labels)))
    grid, affine = fields.read_image(like)
    points = fields.grid_points(grid.shape, affine)
    fields.write_field(output, (points @ (rotation - numpy.eye(3)).T + translation).reshape(grid.shape + (3,)), affine)


if __name__ == "__main__":
    main()
