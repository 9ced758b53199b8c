"""Where the organ is said by something other than a label map: the image alone."""

import json
import unittest

import numpy

from image_test import landmarks_of, texture
from phantom import (CENTRE_LPS, FIXED_AFFINE, FIXED_AXES, MOVING_AFFINE, MOVING_AXES, PhantomTest, SHIFT_LPS, run, save)

INPUT = 2


def organ_image(affine, centre, axes, labels):
    """A textured organ in the dark of air, which is nowhere quite dark, with a hole."""
    grey = numpy.where(labels == 1, texture(affine, centre, axes), 20)
    return (grey + numpy.random.default_rng(2).normal(0, 3, labels.shape)).astype(numpy.float32)


class ImagesAlone(PhantomTest):
    """What a user tries first: two images."""

    def setUp(self):
        super().setUp()
        phantom = self.phantom
        phantom.moving = save(organ_image(MOVING_AFFINE, CENTRE_LPS, MOVING_AXES, phantom.moving_labels_array),
                              MOVING_AFFINE, phantom.moving)
        phantom.fixed = save(organ_image(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, FIXED_AXES, phantom.fixed_labels_array),
                             FIXED_AFFINE, phantom.fixed)

    def register(self, *more, **replaced):
        return self.phantom.register(*more, **{"moving_labels": None, "fixed_labels": None, **replaced})

    def test_two_images_are_registered_and_what_was_taken_is_said(self):
        result = self.register("--landmarks", landmarks_of(self.phantom), "--edge-length", 4, "--no-error-estimate")
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((self.phantom.output / "report.json").read_text())
        volume = 4 / 3 * numpy.pi * MOVING_AXES.prod() / 1000
        self.assertAlmostEqual(report["foreground"]["volume_ml"], volume, delta=0.05 * volume)
        self.assertAlmostEqual(report["foreground"]["threshold"], 260, delta=60)
        self.assertLess(report["target_registration_error"]["all"]["after"]["mean"], 0.5)
        for text in (result.stdout, " ".join(report["notes"]), (self.phantom.output / "report.html").read_text()):
            self.assertIn("no labels say where the organ is", text)
            self.assertIn("--moving-labels", text)

    def test_a_dry_run_says_it_too(self):
        result = self.register("--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("largest piece", result.stdout)

    def test_an_image_without_an_organ_is_refused(self):
        shape = self.phantom.moving_array.shape
        noise = numpy.random.default_rng(5).normal(500, 50, size=shape).astype(numpy.float32)
        for name, array in (("noise", noise), ("flat", numpy.full(shape, 7, numpy.float32))):
            path = save(array, MOVING_AFFINE, self.phantom.folder / (name + ".nii.gz"))
            self.assert_refused(self.register(moving=path), INPUT, name, "no organ", "--moving-labels")

    def test_what_speaks_of_labels_takes_some(self):
        self.assert_refused(self.register("--anchor", 1), INPUT, "--anchor", "--moving-labels")
        self.assert_refused(self.register(fixed_labels=self.phantom.fixed_labels), INPUT, "--moving-labels")
        self.assert_refused(run("register", "--fixed-surface", "a.ply", "-o", self.phantom.output), INPUT,
                            "--moving-labels")


if __name__ == "__main__":
    unittest.main()
