"""Tissues by name: what the report says of them, what lungs gain, and what is refused."""

import json
import shutil
import unittest

import numpy
from phantom import CENTRE_LPS, FIXED_AFFINE, MOVING_AXES, SHIFT_LPS, PhantomTest, ellipsoid, save

INPUT = 2


class Tissues(PhantomTest):
    def report(self, *more, **replaced):
        result = self.phantom.register("--device", "cpu", "--no-error-estimate", *more, **replaced)
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads((self.phantom.output / "report.json").read_text())

    def collapsed(self, axes):
        """Labels of an organ of these half axes, mm; those of the moving one are 15, 12 and 12."""
        labels, _ = ellipsoid(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, axes)
        return save(labels, FIXED_AFFINE, self.phantom.folder / "collapsed.nii.gz")

    def test_the_report_says_which_tissue_each_label_is(self):
        report = self.report("--tissue", "liver", "--label-tissue", "2=tumour")
        self.assertEqual(report["materials"]["1"]["name"], "liver")
        self.assertEqual(report["materials"]["1"]["youngs_modulus_kpa"], 6.0)
        self.assertEqual(report["materials"]["2"]["name"], "tumour")
        self.assertEqual(report["alignment"]["free_stretch"], [[1, 0, 0], [0, 1, 0], [0, 0, 1]])

    def test_a_lung_is_stretched_and_fits(self):
        report = self.report("--tissue", "lung", fixed=None, fixed_labels=self.collapsed([13.5, 10.0, 8.0]))
        stretch = report["alignment"]["free_stretch"]
        self.assertLess(abs(stretch[2][2] - 8 / 12), 0.05)
        self.assertEqual(report["materials"]["1"]["poissons_ratio"], 0.25)
        self.assertNotIn("labels.volume_changed", [doubt["code"] for doubt in report["doubts"]])
        self.assertGreater(report["overlap"]["after"]["all"]["dice"], 0.9)

    def test_a_lung_follows_a_breath_in_its_image(self):
        axes = numpy.array([14.5, 11.5, 9.5])
        fixed = save(ellipsoid(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, axes)[1], FIXED_AFFINE, self.phantom.folder / "breath.nii.gz")
        places = numpy.random.default_rng(1).uniform(-0.5, 0.5, (40, 3))
        table = self.phantom.folder / "places.csv"
        numpy.savetxt(table, numpy.c_[CENTRE_LPS + places * MOVING_AXES, CENTRE_LPS + SHIFT_LPS + places * axes], delimiter=",",
                      header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z", comments="")

        def mean_error(*more):
            self.report("--edge-length", 5, "--landmarks", table, *more, fixed=fixed, fixed_labels=None)
            carried = numpy.genfromtxt(self.phantom.output / "warped_landmarks.csv", delimiter=",", names=True)
            shutil.rmtree(self.phantom.output)
            return carried["after_mm"].mean()

        self.assertLess(mean_error("--tissue", "lung"), 0.8 * mean_error())

    def test_another_tissue_that_collapsed_is_told_of_lungs(self):
        report = self.report("--edge-length", 6, "--rounds", 2, fixed=None, fixed_labels=self.collapsed([14.5, 11.5, 10.5]))
        doubts = {doubt["code"]: doubt for doubt in report["doubts"]}
        self.assertIn("--tissue lung", doubts["labels.volume_changed"]["remedy"])

    def test_a_tissue_that_nobody_knows(self):
        self.assert_refused(self.phantom.register("--tissue", "spleen"), INPUT, "spleen", "lung")
        self.assert_refused(self.phantom.register("--label-tissue", "2=spleen"), INPUT, "spleen", "--label-tissue", "tumour")
        self.assert_refused(self.phantom.register("--label-tissue", "tumour"), INPUT, "LABEL=TISSUE", "3=tumour")

    def test_a_label_that_is_absent(self):
        self.assert_refused(self.phantom.register("--label-tissue", "9=tumour"), INPUT, "--label-tissue", "9", "moving_labels")

    def test_two_sources_of_moduli(self):
        self.assert_refused(self.phantom.register("--tissue", "lung", "--default-poissons-ratio", 0.3), INPUT, "--tissue lung",
                            "--materials")
        table = self.phantom.folder / "materials.toml"
        table.write_text("".join(f"[label.{n}]\nyoungs_modulus_kpa = 3\npoissons_ratio = 0.45\n" for n in (1, 2)))
        self.assert_refused(self.phantom.register("--materials", table, "--label-tissue", "2=tumour"), INPUT, "--label-tissue")


if __name__ == "__main__":
    unittest.main()
