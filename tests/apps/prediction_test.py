"""`warp --displacement displacement.h5`: a scene's frames carry images, labels, points and surfaces."""

import pathlib
import tempfile
import unittest

import h5py
import numpy
from scipy.ndimage import map_coordinates

import nibabel

from pages_phantom import write_ply
from phantom import lps_of_voxels, run, save

# A block that sags, whose top is taken out at half time.
SCENE = """
[geometry]
box = { size_mm = [60, 60, 60], cells = [6, 6, 6] }
[label.1]
youngs_modulus_kpa = 3.0
poissons_ratio = 0.45
[set.base]
side = "-z"
[set.top]
half_space = { point_mm = [0, 0, 40], normal = [0, 0, -1] }
[[fixed]]
set = "base"
[[resection]]
set = "top"
time_s = 0.75
[gravity]
to = [0.6, 0, -0.8]
curve = [[0, 0], [0.5, 1]]
[solve]
frames = 2
"""
SIZE = 48
AFFINE = numpy.array([[-2.0, 0, 0, 15], [0, -2, 0, 15], [0, 0, 2, -15], [0, 0, 0, 1]])  # RAS
RAMP = numpy.array([2.0, 3.0, -1.0])
OUTSIDE = -500


class Prediction(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-test-")
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        (cls.folder / "scene.toml").write_text(SCENE)
        lps = lps_of_voxels(AFFINE, (SIZE, SIZE, SIZE))
        save((lps @ RAMP).astype(numpy.float32), AFFINE, cls.folder / "image.nii.gz")
        inside = ((lps > 0) & (lps < 60)).all(axis=-1)
        save(inside.astype(numpy.uint8) + (inside & (lps[..., 2] > 40)), AFFINE, cls.folder / "labels.nii.gz")
        result = run("simulate", "scene.toml", "-o", "out", "--device", "cpu", folder=cls.folder)
        assert result.returncode == 0, result.stderr
        with h5py.File(cls.folder / "out" / "displacement.h5") as record:
            cls.nodes, cls.moved = record["mesh/nodes"][:], record["displacement"][:]

    def warp(self, source, target, *more):
        result = run("warp", source, "-o", target, "--displacement", "out/displacement.h5", *more, folder=self.folder)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result.stdout

    def array(self, name):
        return numpy.asarray(nibabel.load(self.folder / name).dataobj).astype(float)

    def at(self, array, points):
        ras = points * [-1, -1, 1]
        return map_coordinates(array, ((ras - AFFINE[:3, 3]) @ numpy.linalg.inv(AFFINE[:3, :3]).T).T, order=1)

    def test_an_image_shows_at_each_place_the_tissue_that_moved_there(self):
        self.warp("image.nii.gz", "frame1.nii.gz", "--frame", 1, "--outside", OUTSIDE)
        inner = ((self.nodes > 9) & (self.nodes < 51)).all(axis=1)
        self.assertGreater(numpy.linalg.norm(self.moved[1][inner], axis=1).max(), 3)
        seen = self.at(self.array("frame1.nii.gz"), (self.nodes + self.moved[1])[inner])
        numpy.testing.assert_allclose(seen, self.nodes[inner] @ RAMP, atol=1.0)  # grey values, of 3.7 a mm

    def test_at_rest_nothing_changes(self):
        self.warp("image.nii.gz", "frame0.nii.gz", "--frame", 0)
        numpy.testing.assert_allclose(self.array("frame0.nii.gz"), self.array("image.nii.gz"), atol=1e-3)

    def test_what_was_taken_out_is_gone_from_images_and_labels(self):
        note = self.warp("labels.nii.gz", "left.nii.gz", "--labels")
        self.assertIn("frame 2, at 1 s", note)
        self.warp("labels.nii.gz", "whole.nii.gz", "--labels", "--frame", 1)
        labels, whole, left = (self.array(name) for name in ("labels.nii.gz", "whole.nii.gz", "left.nii.gz"))
        self.assertAlmostEqual((whole == 2).sum() / (labels == 2).sum(), 1, delta=0.1)
        self.assertEqual((left == 2).sum(), 0)
        self.assertAlmostEqual((left == 1).sum() / (labels == 1).sum(), 1, delta=0.1)
        self.warp("image.nii.gz", "cut.nii.gz", "--outside", OUTSIDE)
        self.assertEqual(self.at(self.array("cut.nii.gz"), numpy.array([[30.0, 30, 50]]))[0], OUTSIDE)

    def test_points(self):
        (self.folder / "nodes.csv").write_text(
            "x,y,z\n" + "\n".join(",".join(map(str, node)) for node in self.nodes) + "\n")
        self.warp("nodes.csv", "moved.csv", "--frame", 1)
        moved = numpy.loadtxt(self.folder / "moved.csv", delimiter=",", skiprows=1)
        numpy.testing.assert_allclose(moved, self.nodes + self.moved[1], atol=1e-5)
        self.assertIn("points lay in tissue that was taken out", self.warp("nodes.csv", "cut.csv"))
        cut = numpy.loadtxt(self.folder / "cut.csv", delimiter=",", skiprows=1)
        numpy.testing.assert_allclose(cut, self.nodes + self.moved[2], atol=1e-5, equal_nan=True)

    def test_a_surface(self):
        corners = numpy.array([[10.0, 10, 20], [50, 10, 20], [10, 50, 20], [10, 10, 50]])
        write_ply(self.folder / "tumour.ply", corners, numpy.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]))
        self.warp("tumour.ply", "moved.ply", "--frame", 1)
        result = run("warp", "tumour.ply", "-o", "no.ply", "--displacement", "out/displacement.h5", folder=self.folder)
        self.assertEqual(result.returncode, 2)
        self.assertIn("1 of 4 nodes of 'tumour.ply' lie in tissue that was taken out", result.stderr)
        self.assertFalse((self.folder / "no.ply").exists())

    def test_refusals(self):
        far = AFFINE.copy()
        far[:3, 3] += 400
        save(numpy.ones((8, 8, 8), numpy.float32), far, self.folder / "far.nii.gz")
        (self.folder / "point.csv").write_text("x,y,z\n30,30,30\n")
        for words, reason in (
                (("image.nii.gz", "--displacement", "out/displacement.h5", "--frame", 3), "it holds frames 0 (at rest) to 2"),
                (("image.nii.gz", "--displacement", "image.nii.gz", "--frame", 1), "--frame is of a scene"),
                (("far.nii.gz", "--displacement", "out/displacement.h5"), "shows nothing of the tissue")):
            with self.subTest(reason=reason):
                result = run("warp", words[0], "-o", "no.nii.gz", *words[1:], folder=self.folder)
                self.assertEqual(result.returncode, 2, result.stderr)
                self.assertIn(reason, result.stderr)
                self.assertFalse((self.folder / "no.nii.gz").exists())
        with h5py.File(self.folder / "other.h5", "w") as other:
            other["x"] = 1
        result = run("warp", "point.csv", "-o", "no.csv", "--displacement", "other.h5", folder=self.folder)
        self.assertEqual(result.returncode, 2, result.stderr)


if __name__ == "__main__":
    unittest.main()
