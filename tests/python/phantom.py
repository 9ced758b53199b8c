"""A small pair of label maps and images with a known motion, as arrays."""

import pathlib

import numpy
import tissuewarp

ROOT = pathlib.Path(__file__).resolve().parents[2]
SHIFT = numpy.array([2.0, -1.5, 1.0])  # LPS mm, of the centre
CENTRE = numpy.array([-6.0, 4.0, 14.0])  # LPS mm
SIZE = 40
SPACING = (1.2, 1.1, 1.3)  # x, y, z, mm
MOVING_ORIGIN, FIXED_ORIGIN = numpy.array([-30.0, -18.0, -12.0]), numpy.array([-28.0, -20.0, -11.0])  # LPS mm
EDGE = 6.0  # mm, a few hundred tetrahedra


def ellipsoid(centre, axes, origin):
    """Labels (1 with a core of 2) and a grey image that varies inside, (z, y, x)."""
    z, y, x = numpy.meshgrid(*[numpy.arange(SIZE)] * 3, indexing="ij")
    place = numpy.stack([x, y, z], axis=-1) * SPACING + origin
    scaled = (place - centre) / axes
    radius = numpy.linalg.norm(scaled, axis=-1)
    labels = (radius < 1).astype(numpy.uint8) + (radius < 0.45).astype(numpy.uint8)
    waves = 40 * numpy.sin(5 * scaled).prod(axis=-1)
    grey = numpy.where(radius < 1, 100 + 30 * scaled[..., 0] + waves, 10).astype(numpy.float32)
    return labels, grey


def image(array, origin):
    return tissuewarp.Image(array, SPACING, origin)


MOVING_LABELS, MOVING = (image(a, MOVING_ORIGIN) for a in ellipsoid(CENTRE, [15, 12, 12], MOVING_ORIGIN))
FIXED_LABELS, FIXED = (image(a, FIXED_ORIGIN) for a in ellipsoid(CENTRE + SHIFT, [13.8, 13, 12], FIXED_ORIGIN))
