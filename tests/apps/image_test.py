"""Registration to a bare intraoperative volume: no labels, no points."""

import json
import unittest

import numpy

from phantom import (CENTRE_LPS, FIXED_AFFINE, FIXED_AXES, MOVING_AFFINE, MOVING_AXES, SHIFT_LPS, Phantom, PhantomTest,
                     lps_of_voxels, save)

INPUT = 2


def texture(affine, centre, axes):
    """Plane waves of 5 to 12 mm, fixed to the tissue: without them there would be nothing to match."""
    generator = numpy.random.default_rng(7)
    place = (lps_of_voxels(affine) - centre) / axes
    grey = numpy.full(place.shape[:-1], 500.0)
    for _ in range(40):
        direction = generator.normal(size=3)
        wave = direction / numpy.linalg.norm(direction) * 2 * numpy.pi * 13 / generator.uniform(5, 12)
        grey += 20 * numpy.sin(place @ wave + generator.uniform(0, 2 * numpy.pi))
    return grey.astype(numpy.float32)


def textured_phantom():
    phantom = Phantom()
    phantom.moving = save(texture(MOVING_AFFINE, CENTRE_LPS, MOVING_AXES), MOVING_AFFINE, phantom.moving)
    # Another modality: contrast turned over.
    fixed = 900 - 0.7 * texture(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, FIXED_AXES)
    phantom.fixed = save(fixed.astype(numpy.float32), FIXED_AFFINE, phantom.fixed)
    return phantom


def landmarks_of(phantom):
    unit = numpy.random.default_rng(3).normal(size=(60, 3))
    unit *= 0.9 * numpy.random.default_rng(4).uniform(size=(60, 1)) / numpy.linalg.norm(unit, axis=1, keepdims=True)
    path = phantom.folder / "targets.csv"
    pairs = numpy.hstack([CENTRE_LPS + unit * MOVING_AXES, CENTRE_LPS + SHIFT_LPS + unit * FIXED_AXES])
    numpy.savetxt(path, pairs, fmt="%.4f", delimiter=",", comments="", header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")
    return path


class FromABareVolume(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = textured_phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        cls.result = phantom.register("--edge-length", 4, "--landmarks", landmarks_of(phantom), fixed_labels=None)
        if cls.result.returncode == 0:
            cls.report = json.loads((phantom.output / "report.json").read_text())

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)

    def test_targets_are_hit(self):
        error = self.report["target_registration_error"]["all"]
        self.assertGreater(error["before"]["mean"], 2.0)
        self.assertLess(error["after"]["mean"], 0.4)

    def test_report_says_what_was_matched(self):
        self.assertGreater(self.report["image"]["matched"], 0.5 * self.report["image"]["blocks"])
        self.assertGreater(self.report["image"]["shown_share"], 0.95)
        self.assertLess(self.report["image"]["residual_mm"], 0.3)
        self.assertNotIn("overlap", self.report)
        self.assertIn("blocks found", self.result.stdout)

    def test_page_says_so_too(self):
        page = (self.phantom.output / "report.html").read_text()
        self.assertIn("blocks of the preoperative image were found", page)
        self.assertIn("the warped labels", page)
        self.assertNotIn("Intraoperative labels: boundaries", page)


class WhatCannotBeMatched(PhantomTest):
    def test_contrasts_are_matched_pair_by_pair(self):
        phantom = textured_phantom()
        self.addCleanup(phantom.temporary.cleanup)
        second = save(700 - texture(MOVING_AFFINE, CENTRE_LPS, MOVING_AXES), MOVING_AFFINE,
                      phantom.folder / "second.nii.gz")
        fixed = save(texture(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, FIXED_AXES), FIXED_AFFINE,
                     phantom.folder / "second_fixed.nii.gz")
        result = phantom.register("--edge-length", 6, "--moving", second, "--fixed", fixed, "--landmarks",
                                  landmarks_of(phantom), fixed_labels=None)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("contrast 2:", result.stdout)
        report = json.loads((phantom.output / "report.json").read_text())
        self.assertLess(report["target_registration_error"]["all"]["after"]["mean"], 0.4)
        self.assertGreater(report["contrasts"][0]["matched"], 0.5 * report["contrasts"][0]["blocks"])
        self.assertEqual(report["parameters"]["moving"], [str(phantom.moving), str(second)])

    def test_a_contrast_without_its_pair_is_refused(self):
        phantom = textured_phantom()
        self.addCleanup(phantom.temporary.cleanup)
        result = phantom.register("--moving", phantom.moving, fixed_labels=None)
        self.assertEqual(result.returncode, INPUT)
        self.assertIn("--moving is given 2 times and --fixed 1", result.stderr)
        result = phantom.register("--moving", phantom.moving, "--fixed", phantom.fixed)
        self.assertEqual(result.returncode, INPUT)
        self.assertIn("--match-image", result.stderr)

    def test_a_moving_image_is_needed(self):
        self.assert_refused(self.phantom.register(moving=None, fixed_labels=None), INPUT, "--moving")
        self.assert_refused(self.phantom.register("--match-image", fixed=None), INPUT, "--fixed")

    def test_an_image_of_something_else_is_refused_or_doubted(self):
        phantom = textured_phantom()
        self.addCleanup(phantom.temporary.cleanup)
        noise = numpy.random.default_rng(5).normal(500, 50, size=(48, 48, 48)).astype(numpy.float32)
        result = phantom.register("--edge-length", 4, fixed=save(noise, FIXED_AFFINE, phantom.folder / "noise.nii.gz"),
                                  fixed_labels=None)
        if result.returncode == 0:
            self.assertNotEqual(json.loads((phantom.output / "report.json").read_text())["doubts"], [])
        else:
            self.assertEqual(result.returncode, INPUT, result.stderr)
            self.assertIn("blocks of the moving image", result.stderr)


if __name__ == "__main__":
    unittest.main()
