"""Properties of the degraded volume, on a small head made here: view, slices, noise, contrast, repeatability. And that the
one of the repository, which tests register to, is what the comparison makes of the complete volume."""

import pathlib
import sys
import tempfile
import unittest

import numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
from study import degrade, fields

SHAPE = (72, 80, 61)  # 61: one voxel is left over after slices of three
AFFINE = numpy.diag([-1.0, -1.0, 1.0, 1.0])
AFFINE[:3, 3] = [36.0, 40.0, -30.0]
GREY = {"air": 4.0, "scalp": 300.0, "grey matter": 200.0, "white matter": 320.0, "fluid": 60.0}


def small_head():
    """Grey values, brain mask and the tissue of each voxel: shells about the origin."""
    radius = numpy.linalg.norm(fields.grid_points(SHAPE, AFFINE), axis=1).reshape(SHAPE)
    tissue = numpy.select([radius < 6, radius < 16, radius < 22, radius < 24, radius < 27],
                          ["fluid", "white matter", "grey matter", "fluid", "scalp"], "air")
    voxels = numpy.vectorize(GREY.get)(tissue) + numpy.random.default_rng(4).normal(0.0, 3.0, SHAPE)
    return numpy.maximum(voxels, 0.0), radius < 22, tissue


class Degraded(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.voxels, cls.brain, cls.tissue = small_head()
        cls.centre = numpy.array([-12.0, 8.0, 16.0])
        cls.image, cls.view, cls.affine = degrade.degrade(cls.voxels, AFFINE, cls.brain, cls.centre)

    def pure(self, name):
        """Thick voxels that hold nothing but one tissue."""
        return degrade.thick_slices((self.tissue == name).astype(float), AFFINE)[0] == 1.0

    def test_slices_are_three_millimetres_and_lie_where_they_were(self):
        self.assertEqual(self.image.shape, (72, 80, 20))
        numpy.testing.assert_allclose(numpy.linalg.norm(self.affine[:3, :3], axis=0), [1.0, 1.0, 3.0])
        thick, affine = degrade.thick_slices(fields.grid_points(SHAPE, AFFINE)[:, 2].reshape(SHAPE), AFFINE)
        numpy.testing.assert_allclose(fields.to_points(affine, numpy.array([0.0, 0.0, 7.0]))[2], thick[0, 0, 7])

    def test_the_head_is_found_without_its_air(self):
        truth = self.tissue != "air"
        found = degrade.head(self.voxels)
        self.assertTrue(found[self.brain].all())
        # Smoothing before the threshold widens the head by up to 1.5 mm: 8 % of so small a one's Dice.
        self.assertGreater(2.0 * (found & truth).sum() / (found.sum() + truth.sum()), 0.91)

    def test_a_third_of_the_head_is_seen_about_the_centre(self):
        head = degrade.thick_slices((self.tissue != "air").astype(float), AFFINE)[0] > 0.5
        self.assertAlmostEqual((self.view & head).sum() / head.sum(), 1 / 3, delta=0.02)
        distance = numpy.linalg.norm(fields.grid_points(self.view.shape, self.affine) - self.centre, axis=1)
        seen = self.view.ravel()
        # A ball: no hole and no piece apart, but for the half slice that its rim is rounded to.
        self.assertLess(distance[seen].max() - distance[~seen].min(), 4.0)
        self.assertTrue(numpy.all(self.image[~self.view] == 0))
        self.assertTrue(numpy.all(self.image[self.view] > 0))

    def test_the_noise_is_a_tenth_of_the_brains_mean(self):
        brain = degrade.thick_slices(self.brain.astype(float), AFFINE)[0] > 0.5
        clean, _ = degrade.thick_slices(degrade.other_contrast(self.voxels), AFFINE)
        bright = self.view & self.pure("grey matter")  # Rician noise is Gaussian only well above its deviation
        self.assertGreater(bright.sum(), 1000)
        found = (self.image - clean)[bright].std() / clean[brain].mean()
        self.assertAlmostEqual(found, 0.10, delta=0.01)

    def test_the_contrast_is_inverted_and_not_linear(self):
        mean = {name: self.image[self.view & self.pure(name)].mean() for name in ("fluid", "grey matter", "white matter", "air")}
        self.assertGreater(mean["fluid"], 1.5 * mean["grey matter"])
        self.assertGreater(mean["grey matter"], 1.5 * mean["white matter"])
        self.assertLess(mean["air"], 0.5 * mean["grey matter"])
        steps = (mean["fluid"] - mean["grey matter"]) / 140.0, (mean["grey matter"] - mean["white matter"]) / 120.0
        self.assertGreater(abs(steps[0] - steps[1]), 0.1 * abs(steps[1]))

    def test_it_repeats_and_its_seed_matters(self):
        again, _, _ = degrade.degrade(self.voxels, AFFINE, self.brain, self.centre)
        numpy.testing.assert_array_equal(again, self.image)
        other, _, _ = degrade.degrade(self.voxels, AFFINE, self.brain, self.centre, seed=21)
        self.assertGreater((other != self.image)[self.view].mean(), 0.5)

    def test_the_repository_holds_what_is_compared(self):
        head = ROOT / "data" / "brainshift"
        with tempfile.TemporaryDirectory() as folder:
            image, view = (pathlib.Path(folder) / name for name in ("image.nii.gz", "view.nii.gz"))
            degrade.degrade_files(head / "intraop.nii.gz", head / "intraop_labels.nii.gz", head / "intraop_surface.ply", image, view)
            voxels, affine = fields.read_image(image)
            kept, kept_affine = fields.read_image(head / "intraop_degraded.nii.gz")
            numpy.testing.assert_array_equal(kept, voxels)
            numpy.testing.assert_array_equal(kept_affine, affine)


if __name__ == "__main__":
    unittest.main()
