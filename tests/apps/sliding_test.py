"""Labels that slide on one another, along the command line."""

import json
import unittest

from phantom import PhantomTest, run

INPUT = 2


class SlidingLabels(PhantomTest):
    def test_the_report_says_how_far_they_slid(self):
        result = self.phantom.register("--no-align", "--sliding", "1,2", "--edge-length", 4, "--no-error-estimate")
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((self.phantom.output / "report.json").read_text())
        slid = report["sliding"]
        self.assertEqual(slid["labels"], [[1, 2]])
        self.assertLessEqual(slid["mean_mm"], slid["largest_mm"])
        self.assertIn("sliding", report["jacobian"]["unfolded"]["fixed_to_moving"])

    def test_a_prepared_patient_gives_the_same(self):
        model = self.phantom.folder / "patient.tw"
        prepared = run("prepare", "--moving", self.phantom.moving, "--moving-labels", self.phantom.moving_labels, "--for-labels",
                       "--edge-length", 4, "--sliding", "1,2", "-o", model, "--quiet")
        self.assertEqual(prepared.returncode, 0, prepared.stderr)
        updated = run("update", model, "--no-align", "--fixed", self.phantom.fixed, "--fixed-labels", self.phantom.fixed_labels,
                      "--output", self.phantom.folder / "updated", "--no-error-estimate", "--quiet")
        self.assertEqual(updated.returncode, 0, updated.stderr)
        direct = self.phantom.register("--no-align", "--sliding", "1,2", "--edge-length", 4, "--no-error-estimate")
        self.assertEqual(direct.returncode, 0, direct.stderr)
        slid = [json.loads((folder / "report.json").read_text())["sliding"]
                for folder in (self.phantom.folder / "updated", self.phantom.output)]
        self.assertEqual(slid[0], slid[1])

    def test_what_cannot_slide_is_refused(self):
        for labels, words in (("1", "give pairs"), ("1,1", "cannot slide"), ("1,9", "9"), ("1,x", "is no label")):
            with self.subTest(labels=labels):
                result = self.phantom.register("--no-align", "--sliding", labels)
                self.assertEqual(result.returncode, INPUT)
                self.assertIn(words, result.stderr)


unittest.main()
