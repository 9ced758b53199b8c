"""Scoring of displacement fields on maps whose inverse is known in closed form."""

import pathlib
import sys
import tempfile
import unittest
import zlib

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
from study import fields, scoring

# Anisotropic, oblique and with its second axis reversed: a wrong order of axes or a lost sign shows up in millimetres.
SHAPE = (50, 44, 30)
TURN = numpy.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
AFFINE = numpy.eye(4)
AFFINE[:3, :3] = TURN @ numpy.diag([1.0, -1.2, 2.0])
AFFINE[:3, 3] = [-40.0, 35.0, 10.0]
CENTRE = fields.to_points(AFFINE, (numpy.array(SHAPE) - 1.0) / 2.0)


def backward_field(displacement):
    points = fields.grid_points(SHAPE, AFFINE)
    return displacement(points).reshape(SHAPE + (3,)).astype(numpy.float32)


def targets(count=400):
    """Intraoperative points within 9 mm of the centre, so that neither they nor their preimages leave the grid."""
    directions = numpy.random.default_rng(1).normal(size=(count, 3))
    return CENTRE + 9.0 * directions / numpy.linalg.norm(directions, axis=1)[:, None]


class Inversion(unittest.TestCase):
    def test_a_wave_is_inverted_to_its_interpolation_error(self):
        def wave(points):  # x -> y: only the first coordinate moves, by the third, so that the inverse is explicit
            return numpy.stack([3.0 * numpy.sin(points[:, 2] / 15.0), 0.0 * points[:, 0], 0.0 * points[:, 0]], axis=1)
        fixed = targets()
        moving = fixed + wave(fixed)
        errors = scoring.score_backward(backward_field(wave), AFFINE, moving, fixed)
        self.assertEqual(errors["not_inverted"], 0)
        # Linear interpolation at 2 mm is off by h^2/8 |f''| = 0.007 mm; the iteration ends at 0.01 mm.
        self.assertLess(errors["maximum"], 0.02)

    def test_a_stretch_beyond_the_plain_iteration_is_inverted(self):
        stretch = lambda points: 1.5 * (points - CENTRE)  # plain fixed-point iteration diverges at a slope above 1
        fixed = targets()
        moving = fixed + stretch(fixed)
        errors = scoring.score_backward(backward_field(stretch), AFFINE, moving, fixed)
        self.assertEqual(errors["not_inverted"], 0)
        self.assertLess(errors["maximum"], 0.01)

    def test_a_constant_error_is_found_in_full(self):
        offset = numpy.array([1.0, -2.0, 2.0])
        fixed = targets()
        field = backward_field(lambda points: numpy.broadcast_to(offset, points.shape))
        errors = scoring.score_backward(field, AFFINE, fixed, fixed)
        for name in ("mean", "median", "p95", "maximum"):
            self.assertAlmostEqual(errors[name], 3.0, places=3)
        self.assertEqual(errors["count"], len(fixed))

    def test_places_where_a_fold_stops_the_iteration_are_counted(self):
        def folds(points):  # the first coordinate turns back on itself: slope 1 - 4 cos
            return numpy.stack([-12.0 * numpy.sin(points[:, 0] / 3.0), 0.0 * points[:, 0], 0.0 * points[:, 0]], axis=1)
        fixed = targets()
        errors = scoring.score_backward(backward_field(folds), AFFINE, fixed + folds(fixed), fixed)
        self.assertGreater(errors["not_inverted"], 0)
        self.assertGreater(errors["maximum"], 3.0)  # a wrong sheet of the fold is an error, not an inverse


class Folds(unittest.TestCase):
    def test_determinants_of_a_linear_map(self):
        matrix = numpy.array([[1.2, 0.3, 0.0], [0.0, 0.7, 0.2], [0.1, 0.0, 1.1]])
        field = backward_field(lambda points: (points - CENTRE) @ (matrix - numpy.eye(3)).T)
        found = fields.jacobian_determinants(field, AFFINE)
        numpy.testing.assert_allclose(found, numpy.linalg.det(matrix), atol=1e-3)  # also across the seams of the slabs

    def test_a_mirrored_slab_counts_as_folded_there_alone(self):
        index = numpy.arange(SHAPE[0])
        profile = numpy.where((index >= 10) & (index < 20), -2.0 * (index - 10.0), numpy.where(index >= 20, -20.0, 0.0))
        field = (profile[:, None, None, None] * TURN[:, 0]).astype(numpy.float32) * numpy.ones(SHAPE + (1,), numpy.float32)
        organ = numpy.zeros(SHAPE, bool)
        organ[12:18] = True
        folds = fields.folded_share(field, AFFINE, organ)
        self.assertEqual(folds["organ"], 1.0)
        # 9 slices have both neighbours in the slab; at its two ends the central difference gives exactly 0, folded too.
        self.assertAlmostEqual(folds["grid"], 11 / SHAPE[0], places=3)
        self.assertEqual(fields.folded_share(0 * field, AFFINE, organ), dict(organ=0.0, grid=0.0))


class Files(unittest.TestCase):
    def test_an_oblique_metaimage_and_nifti_place_the_same_voxels(self):
        voxels = numpy.random.default_rng(2).normal(size=SHAPE + (3,)).astype("<f4")
        spacing = numpy.linalg.norm(AFFINE[:3, :3], axis=0)
        # MetaImage lists the unit vector of the first axis, then of the second, then of the third.
        axes = (AFFINE[:3, :3] / spacing).T.ravel()
        header = (f"ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = True\n"
                  f"TransformMatrix = {' '.join(map(repr, map(float, axes)))}\nOffset = {' '.join(map(str, AFFINE[:3, 3]))}\n"
                  f"ElementSpacing = {' '.join(map(repr, map(float, spacing)))}\nDimSize = {' '.join(map(str, SHAPE))}\n"
                  f"ElementNumberOfChannels = 3\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n")
        with tempfile.TemporaryDirectory() as folder:
            meta, nifti = pathlib.Path(folder) / "field.mha", pathlib.Path(folder) / "field.nii.gz"
            meta.write_bytes(header.encode() + zlib.compress(voxels.transpose(2, 1, 0, 3).tobytes()))
            fields.write_field(nifti, voxels, AFFINE)
            for path in (meta, nifti):
                read, affine = fields.read_field(path)
                numpy.testing.assert_array_equal(read, voxels)
                numpy.testing.assert_allclose(affine, AFFINE, atol=1e-5)

    def test_an_organ_mask_follows_its_place_onto_another_grid(self):
        organ = numpy.zeros(SHAPE, numpy.uint8)
        organ[20:30, 10:20, 5:15] = 4
        shifted = AFFINE.copy()
        shifted[:3, 3] = fields.to_points(AFFINE, numpy.array([5.0, 4.0, 3.0]))
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "organ.nii.gz"
            fields.write_image(path, organ, AFFINE)
            found = fields.organ_mask(path, (40, 30, 20), shifted)
        numpy.testing.assert_array_equal(found, organ[5:45, 4:34, 3:23] > 0)


if __name__ == "__main__":
    unittest.main()
