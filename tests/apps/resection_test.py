"""Tissue that is gone by the time of the operation."""

import json
import unittest

import h5py
import nibabel
import numpy

from phantom import CENTRE_LPS, FIXED_AFFINE, FIXED_AXES, MOVING_AXES, SHIFT_LPS, Phantom, PhantomTest, lps_of_voxels, run, save

INPUT = 2


def voxels(path):
    return numpy.asarray(nibabel.load(str(path)).dataobj)


def dice(a, b):
    return 2 * (a & b).sum() / (a.sum() + b.sum())


def after_resection(phantom):
    """The core is gone: background in the labels, dark in the image."""
    gone = phantom.fixed_labels_array == 2
    phantom.fixed_labels = save(numpy.where(gone, 0, phantom.fixed_labels_array).astype(numpy.uint8), FIXED_AFFINE,
                                phantom.folder / "fixed_labels.nii.gz")
    phantom.fixed = save(numpy.where(gone, 12, phantom.fixed_array).astype(numpy.float32), FIXED_AFFINE,
                         phantom.folder / "fixed.nii.gz")
    return gone


class AResection(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = Phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        cls.gone = after_resection(phantom)
        cls.points = phantom.folder / "points.csv"
        numpy.savetxt(cls.points, [CENTRE_LPS, CENTRE_LPS + [10, 0, 0]], delimiter=",", header="x,y,z", comments="")
        unit = numpy.array([[0, 0, 0], [0.7, 0, 0], [0, 0.7, 0], [0, 0, -0.7]])
        pairs = numpy.hstack([CENTRE_LPS + unit * MOVING_AXES, CENTRE_LPS + SHIFT_LPS + unit * FIXED_AXES])
        numpy.savetxt(phantom.folder / "landmarks.csv", pairs, delimiter=",", comments="",
                      header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")
        cls.result = phantom.register("--no-align", "--resected", 2, "--edge-length", 3, "--points", cls.points, "--landmarks",
                                      phantom.folder / "landmarks.csv", "--write", "markups")

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)
        self.output = self.phantom.output
        self.report = json.loads((self.output / "report.json").read_text())

    def test_a_hole_is_left(self):
        gap = voxels(self.output / "gap.nii.gz")
        self.assertEqual(sorted(numpy.unique(gap)), [0, 1])
        self.assertGreater(dice(gap == 1, self.gone), 0.85)
        self.assertTrue((voxels(self.output / "warped.nii.gz")[gap == 1] == 0).all())
        self.assertTrue((voxels(self.output / "warped_labels.nii.gz")[gap == 1] == 0).all())
        self.assertTrue(numpy.isnan(voxels(self.output / "uncertainty.nii.gz")[gap == 1]).all())
        self.assertTrue((voxels(self.output / "uncertainty_trust.nii.gz")[gap == 1] == 0).all())
        self.assertTrue(numpy.isfinite(voxels(self.output / "displacement_fixed_to_moving.nii.gz")).all())

    def test_the_rest_follows(self):
        self.assertGreater(self.report["overlap"]["after"]["1"]["dice"], 0.93)
        self.assertNotIn("2", self.report["overlap"]["after"])
        self.assertEqual([doubt["code"] for doubt in self.report["doubts"]], [])
        self.assertNotIn("2", self.report["materials"])
        with h5py.File(self.output / "record.h5") as record:
            self.assertEqual(set(record["mesh/labels"][:]), {1})

    def test_what_is_told(self):
        resected = self.report["resected"]
        self.assertEqual((resected["labels"], resected["value"]), ([2], 0))
        core_ml = (self.phantom.moving_labels_array == 2).sum() / 1000
        self.assertAlmostEqual(resected["volume_ml"], core_ml, 6)
        self.assertAlmostEqual(resected["gap_ml"], (voxels(self.output / "gap.nii.gz") == 1).sum() / 1000, 6)
        self.assertIn("resected: ", self.result.stdout)
        self.assertIn("gap.nii.gz", self.report["outputs"])
        self.assertIn("Resected tissue: ", (self.output / "report.html").read_text())

    def test_points_of_what_is_gone_have_no_place(self):
        carried = numpy.genfromtxt(self.output / "warped_points.csv", delimiter=",", names=True)
        self.assertTrue(numpy.isnan(carried["x"][0]) and numpy.isfinite(carried["x"][1]))
        markups = json.loads((self.output / "warped_points.mrk.json").read_text())["markups"][0]["controlPoints"]
        self.assertEqual([point["label"] for point in markups], ["2"])
        self.assertEqual(self.report["target_registration_error"]["all"]["after"]["count"], 3)
        self.assertIn("1 of 4 landmarks lay in resected tissue", self.result.stdout)

    def test_the_record_leaves_the_same_hole(self):
        warped = self.phantom.folder / "again.nii.gz"
        done = run("warp", self.phantom.moving, "--output", warped, "--record", self.output / "record.h5", "--reference",
                   self.phantom.fixed, "--outside", -5)
        self.assertEqual(done.returncode, 0, done.stderr)
        gap = voxels(self.output / "gap.nii.gz")
        self.assertTrue((voxels(warped)[gap == 1] == -5).all())
        shown = (gap == 0) & (voxels(warped) != -5)  # in the moving image
        numpy.testing.assert_allclose(voxels(warped)[shown], voxels(self.output / "warped.nii.gz")[shown], atol=0.05)
        points = self.phantom.folder / "carried.csv"
        run("warp", self.points, "--output", points, "--record", self.output / "record.h5")
        self.assertTrue(numpy.isnan(numpy.genfromtxt(points, delimiter=",", names=True)["x"][0]))


class ResectionsOfAPatient(PhantomTest):
    def test_a_prepared_patient_gives_the_same(self):
        after_resection(self.phantom)
        patient = self.phantom.folder / "patient.tw"
        made = run("prepare", "--moving", self.phantom.moving, "--moving-labels", self.phantom.moving_labels,
                   "--resected", 2, "--edge-length", 3, "-o", patient)
        self.assertEqual(made.returncode, 0, made.stderr)
        results = []
        for folder, arguments in (("update", ("update", patient)),
                                  ("register", ("register", "--moving", self.phantom.moving, "--moving-labels",
                                                self.phantom.moving_labels, "--resected", 2, "--edge-length", 3))):
            output = self.phantom.folder / folder
            done = run(*arguments, "--fixed", self.phantom.fixed, "--fixed-labels", self.phantom.fixed_labels,
                       "--output", output, "--no-error-estimate")
            self.assertEqual(done.returncode, 0, done.stderr)
            results.append([voxels(output / name) for name in ("warped.nii.gz", "gap.nii.gz")])
        for a, b in zip(*results):
            numpy.testing.assert_array_equal(a, b)
        self.assert_refused(run("update", patient, "--fixed", self.phantom.fixed, "--resected", 1, "--output",
                                self.phantom.output), INPUT, "--resected makes the model and belongs to prepare")

    def register(self, *more, **replaced):
        done = self.phantom.register("--no-align", "--edge-length", 3, "--no-error-estimate", *more, **replaced)
        self.assertEqual(done.returncode, 0, done.stderr)
        return json.loads((self.phantom.output / "report.json").read_text()), voxels(self.phantom.output / "gap.nii.gz")

    def test_labels_that_vanished_are_found(self):
        after_resection(self.phantom)
        report, found = self.register("--resected", "auto")
        self.assertEqual((report["resected"]["labels"], report["doubts"]), ([2], []))
        self.assertIn("the fixed labels lack them: labels 2", " ".join(report["notes"]))
        _, told = self.register("--resected", "2")
        numpy.testing.assert_array_equal(found, told)

    def test_nothing_is_found_where_nothing_is_gone(self):
        report, gap = self.register("--resected", "auto", "--rounds", 2, fixed_labels=None)
        self.assertIn("resected.not_found", [doubt["code"] for doubt in report["doubts"]])
        self.assertEqual((report["resected"]["labels"], gap.max()), ([], 0))
        self.assertEqual(voxels(self.phantom.output / "cavity.nii.gz").max(), 0)

    def test_tissue_that_is_still_there_is_doubted(self):
        report, _ = self.register("--resected", "2")
        self.assertIn("resected.filled", [doubt["code"] for doubt in report["doubts"]])

    def test_auto_needs_something_to_look_at(self):
        self.assert_refused(self.phantom.register("--resected", "auto", "--fixed-points", "pairs.csv", fixed_labels=None),
                            INPUT, "--resected auto looks for what is gone in an image or labels")
        self.assert_refused(run("prepare", "--moving-labels", self.phantom.moving_labels, "--resected", "auto", "-o",
                                self.phantom.folder / "patient.tw"), INPUT, "give it to register")

    def test_labels_that_cannot_be_resected(self):
        for options, words in ((("--resected", "7"), ("moving_labels.nii.gz", "label 7 is absent", "1, 2")),
                               (("--resected", "2", "--anchor", "2"), ("choose one",)),
                               (("--resected", "tumour"), ("--resected 'tumour'",)),
                               (("--resected", "1,2"), ("nothing is left",))):
            self.assert_refused(self.phantom.register(*options, "--dry-run"), INPUT, *words)
        self.assert_refused(self.phantom.register("--resected", 2, moving_labels=None, fixed_labels=None), INPUT,
                            "--resected speaks of labels")

    def test_a_plan_says_it(self):
        planned = self.phantom.register("--resected", "2", "--dry-run")
        self.assertEqual(planned.returncode, 0, planned.stderr)
        self.assertIn("gone          2", planned.stdout)
        self.assertIn("gap.nii.gz", planned.stdout)


if __name__ == "__main__":
    unittest.main()
