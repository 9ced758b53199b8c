"""Synthetic breaths: masks and images of lungs at full inspiration and at full expiration, and where points within went.

The lungs are those of two patients (lung-ct and torso-4dct of the data folder), as one lung and its mirror image, in another
size and shape with every seed. The breath is a smooth map without folds: the diaphragm rises by 10 to 60 mm under a resting
apex, more behind than in front or the other way, the chest sinks towards the spine, lungs narrow, whirls of some mm let tissue
slide along the chest wall, and the patient lies a little otherwise. The volume shrinks by 20 to 45 %. Images hold the patients'
CT within the lungs, soft tissue around them that shows nothing, and noise.
"""

import dataclasses

import numpy
from scipy import ndimage

from study import fields

SPACING = 2.5  # mm, of both masks
COARSE = 10.0  # mm, where the inverse of a map is found
MARGIN = 12.0  # mm of background about them
POINTS = 300
WALL, NOISE = 40, 20  # HU
VOLUME = (0.55, 0.80)  # expiration over inspiration
CHOOSING, REPORTING = range(1, 9), range(101, 113)  # seeds


@dataclasses.dataclass
class Breath:
    inspiration: numpy.ndarray  # masks, with the affines from index to LPS mm
    inspiration_affine: numpy.ndarray
    expiration: numpy.ndarray
    expiration_affine: numpy.ndarray
    before: numpy.ndarray  # points in the lungs, n x 3, LPS mm, at inspiration …
    after: numpy.ndarray  # … and at expiration
    inspiration_image: numpy.ndarray  # int16, HU, on the grids of the masks
    expiration_image: numpy.ndarray


def lung_of_torso(data):
    """Right lung at inspiration, the largest air within the body, without the trachea; its affine; the CT."""
    voxels, affine = fields.read_image(data / "real" / "torso-4dct" / "t0.nii.gz")
    labels, _ = ndimage.label(voxels < -400)
    sizes = numpy.bincount(labels.ravel())
    sizes[[0, labels[0, 0, 0]]] = 0
    lung = ndimage.binary_closing(labels == sizes.argmax(), iterations=3)
    labels, _ = ndimage.label(ndimage.binary_opening(lung, iterations=4))
    sizes = numpy.bincount(labels.ravel())
    sizes[0] = 0
    return labels == sizes.argmax(), affine, voxels


def lung_of_follow_up(data):
    voxels, affine = fields.read_image(data / "lung-ct" / "moving_mask.mha")
    return voxels > 0, affine, fields.read_image(data / "lung-ct" / "moving.mha")[0]


def surface_level(mask):
    return ndimage.gaussian_filter(mask.astype(numpy.float32), 1.0)


class Body:
    """One lung and its mirror image about a sagittal plane beside it, of another size and shape."""

    def __init__(self, lung, affine, grey, draw):
        self.level, self.affine, self.grey = surface_level(lung), affine, numpy.where(lung, grey, WALL).astype(numpy.float32)
        points = fields.to_points(affine, numpy.argwhere(lung))
        self.centre = points.mean(axis=0)
        self.shape = numpy.diag(draw.uniform(0.9, 1.2, 3)) + draw.uniform(-0.08, 0.08, (3, 3))
        low, high = points.min(axis=0), points.max(axis=0)
        # The lung lies on one side of the body: its mirror plane is on the other side of it than the ribs.
        self.plane = (low[0] if self.centre[0] > 0.5 * (low[0] + high[0]) else high[0]) - self.centre[0]
        self.gap = draw.uniform(10, 40) * (-1 if self.plane < 0 else 1)

    def index(self, points):
        """Of points about the middle plane (x = 0, mm), in the patient's images."""
        side = -1 if self.plane > 0 else 1
        local = points.copy()
        local[:, 0] = side * numpy.abs(points[:, 0]) + self.plane + 0.5 * self.gap
        return fields.to_index(self.affine, local @ numpy.linalg.inv(self.shape).T + self.centre).T

    def inside(self, points):
        """Whether points lie in one of the lungs."""
        return ndimage.map_coordinates(self.level, self.index(points), order=1, mode="constant") > 0.5

    def image(self, points):
        """HU, without noise."""
        return ndimage.map_coordinates(self.grey, self.index(points), order=1, mode="constant", cval=WALL)


def drawn_map(low, high, draw):
    """A breath of lungs between two corners of their box: points at inspiration to points at expiration."""
    height, depth = high[2] - low[2], high[1] - low[1]
    lift = draw.uniform(10, min(60, 0.3 * height))
    power, tilt = draw.uniform(1.0, 2.0), draw.uniform(-0.3, 0.5)
    sink, narrow = draw.uniform(0.02, 0.2), draw.uniform(0.0, 0.07)
    whirls = [(draw.uniform(low, high), draw.uniform(40, 70), draw.normal(size=3)) for _ in range(6)]
    whirls = [(c, w, a / numpy.linalg.norm(a) * draw.uniform(4, 10) / (0.6 * w)) for c, w, a in whirls]
    angles, shift = numpy.radians(draw.uniform(-3, 3, 3)), draw.uniform(-15, 15, 3)

    def move(points):
        below = numpy.clip((high[2] - points[:, 2]) / height, 0, 1.3)
        behind = (points[:, 1] - low[1]) / depth - 0.5
        moved = points.copy()
        moved[:, 2] += lift * below**power * (1 + tilt * numpy.clip(behind, -0.7, 0.7))
        moved[:, 1] += (high[1] - points[:, 1]) * sink * (0.5 + 0.5 * below)
        moved[:, 0] *= 1 - narrow
        for centre, width, spin in whirls:
            away = moved - centre
            fall = numpy.exp(-0.5 * (away**2).sum(axis=1) / width**2)
            moved = moved + numpy.cross(spin, away) * fall[:, None]
        for axis, angle in enumerate(angles):
            turn, (i, j) = numpy.eye(3), [k for k in range(3) if k != axis]
            turn[[i, i, j, j], [i, j, i, j]] = numpy.cos(angle), -numpy.sin(angle), numpy.sin(angle), numpy.cos(angle)
            moved = moved @ turn.T
        return moved + shift

    return move


def inverse(move, points, start):
    """Points that `move` takes to `points`, by Newton's method with the affine map nearest to it."""
    sample = move(start)
    homogeneous = numpy.c_[start, numpy.ones(len(start))]
    back = numpy.linalg.inv(numpy.linalg.lstsq(homogeneous, sample, rcond=None)[0][:3])
    found = points @ back + (start.mean(axis=0) - sample.mean(axis=0) @ back)
    for _ in range(40):
        found = found + (points - move(found)) @ back
    return found


def grid_about(low, high, spacing=SPACING):
    shape = tuple(numpy.ceil((high - low + 2 * MARGIN) / spacing).astype(int) + 1)
    affine = numpy.diag([spacing] * 3 + [1.0])
    affine[:3, 3] = low - MARGIN
    return shape, affine


def inverse_on_grid(move, low, high, start):
    """The inverse at any points between two corners: found on a coarse grid, 0.1 mm beside it in between."""
    shape, affine = grid_about(low, high, COARSE)
    points = fields.grid_points(shape, affine)
    shift = (inverse(move, points, start) - points).reshape(shape + (3,))
    return lambda asked: asked + fields.sample(shift, affine, asked)


def drawn(body, points, shape, seed):
    """Mask and image at points of a body at inspiration."""
    noise = numpy.random.default_rng(seed).normal(0, NOISE, len(points))
    return body.inside(points).reshape(shape), (body.image(points) + noise).round().astype(numpy.int16).reshape(shape)


def breath(seed, data):
    """The breath of a seed; even seeds breathe with the lung of torso-4dct, odd ones with that of lung-ct."""
    draw = numpy.random.default_rng(seed)
    body = Body(*(lung_of_follow_up if seed % 2 else lung_of_torso)(data), draw)
    shape, affine = grid_about(numpy.array([-220.0, -180.0, -220.0]), numpy.array([220.0, 180.0, 220.0]))
    wide = body.inside(fields.grid_points(shape, affine)).reshape(shape)
    inner = fields.to_points(affine, numpy.argwhere(wide))
    few = inner[:: len(inner) // 2000]
    low, high = inner.min(axis=0), inner.max(axis=0)
    while True:
        move = drawn_map(low, high, draw)
        volume = numpy.linalg.det(numpy.linalg.lstsq(numpy.c_[few, numpy.ones(len(few))], move(few), rcond=None)[0][:3])
        if VOLUME[0] <= volume <= VOLUME[1]:
            break
    first = grid_about(low, high)
    inspiration, early = drawn(body, fields.grid_points(*first), first[0], seed)
    moved = move(few)
    low, high = moved.min(axis=0) - MARGIN, moved.max(axis=0) + MARGIN
    back, second = inverse_on_grid(move, low, high, few), grid_about(low, high)
    expiration, late = drawn(body, back(fields.grid_points(*second)), second[0], seed + 10**6)
    deep = fields.to_points(first[1], numpy.argwhere(ndimage.binary_erosion(inspiration, iterations=2)))
    before = deep[draw.choice(len(deep), POINTS, replace=False)]
    return Breath(inspiration.astype(numpy.uint8), first[1], expiration.astype(numpy.uint8), second[1], before, move(before),
                  early, late)
