"""Points seen during the operation, and how well: what a model may be registered to besides images. LPS mm."""

import numpy

from . import _core
from .errors import InvalidInput


def as_points(points, name="points"):
    """(P, 3) float64. Raises InvalidInput for other shapes."""
    array = numpy.asarray(points, dtype=float)
    if array.ndim != 2 or array.shape[1] != 3:
        raise InvalidInput(f"{name}: the shape is {array.shape}; give (P, 3), LPS mm")
    return array


class SurfacePoints:
    """Points on a part of the organ's outer surface: a laser or stereo patch, the sweep of a tracked probe.

    points     (P, 3), LPS mm, fixed frame
    normals    (P, 3), unit, outward; None where they are not known
    deviation  mm, standard deviation of a point along the normal
    """

    def __init__(self, points, normals=None, deviation=1.0):
        normals = None if normals is None else as_points(normals, "normals")
        self._data = _core.SurfacePoints(as_points(points), normals, deviation)


class PointPairs:
    """Points of the tissue that were found again: landmarks, vessel branchings.

    moving, fixed  (P, 3) each, LPS mm, each in its frame
    deviation      mm, standard deviation of a pair along each axis
    """

    def __init__(self, moving, fixed, deviation=1.0):
        self._data = _core.PointPairs(as_points(moving, "moving"), as_points(fixed, "fixed"), deviation)


class Curves:
    """Centre lines of vessels before the operation, and points along the same ones during it.

    moving     list of polylines, (P, 3) each, LPS mm, moving frame
    fixed      (P, 3), LPS mm, fixed frame
    tangents   (P, 3), along the vessel at each fixed point, either sign; None where not known
    deviation  mm, standard deviation of a fixed point along each axis across the vessel
    """

    def __init__(self, moving, fixed, tangents=None, deviation=1.0):
        tangents = None if tangents is None else as_points(tangents, "tangents")
        lines = [as_points(line, "moving") for line in moving]
        self._data = _core.Curves(lines, as_points(fixed, "fixed"), tangents, deviation)
