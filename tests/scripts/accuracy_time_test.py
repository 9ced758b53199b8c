"""What scripts/accuracy_time varies, and what its figure shows."""

import pathlib
import subprocess
import sys
import tempfile
import unittest
import xml.etree.ElementTree

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
from study import chart, sweep
from study.tools import PEERS, Elastix, Plastimatch, Tissuewarp


def point(tool, series, seconds, error):
    return dict(tool=tool, series=series, seconds=seconds, error=error)


class Sweep(unittest.TestCase):
    def settings(self, tool):
        with tempfile.TemporaryDirectory() as folder:
            found = sweep.settings(tool, (12, 6), (2,), pathlib.Path(folder))
            texts = ["".join(path.read_text() for path in each.tool.settings) for each in found]
        return found, texts

    def test_iterations_of_every_stage_are_scaled_and_nothing_else(self):
        stages = ["elastix-affine.txt", "elastix-bspline-correlation.txt"]
        found, texts = self.settings(Elastix("fixed", "moving", stages))
        self.assertEqual([each.value for each in found], ["x 0.0625", "x 0.125", "x 0.25", "x 0.5", "x 1", "x 2"])
        whole = "".join((PEERS / stage).read_text() for stage in stages)
        self.assertEqual(texts[4], whole)
        self.assertEqual(texts[5].count("(MaximumNumberOfIterations 1000)"), 2)
        self.assertEqual(texts[5].replace("Iterations 1000", "Iterations 500"), whole)

    def test_plastimatch_takes_one_iteration_at_the_least(self):
        found, texts = self.settings(Plastimatch("fixed", "moving", "plastimatch-mean-squares.txt"))
        self.assertEqual(sweep.name_of(found[0].tool), "plastimatch")
        self.assertIn("max_its=4\n", texts[0])  # of 60
        self.assertIn("max_its=120\n", texts[-1])

    def test_options_of_the_program(self):
        found, _ = self.settings(Tissuewarp(["--moving", "a"]))
        self.assertEqual(found[0].tool.arguments, ["--moving", "a"])
        self.assertIn(["--moving", "a", "--edge-length", 12], [each.tool.arguments for each in found])
        self.assertEqual({each.series for each in found}, {"default", "mesh", "rounds", "budget"})


class Chart(unittest.TestCase):
    def test_the_front_is_what_nothing_beats(self):
        points = [point("elastix", "iterations", *values) for values in ((4, 1), (1, 3), (2, 5), (8, 1.5), (16, 0.5))]
        self.assertEqual([(p["seconds"], p["error"]) for p in chart.front(points)], [(1, 3), (4, 1), (16, 0.5)])

    def test_faster_is_to_the_left_and_better_is_lower(self):
        text = chart.figure({"a <case>": [point("elastix", "iterations", 10, 1.0), point("elastix", "iterations", 100, 0.2)]})
        drawing = xml.etree.ElementTree.fromstring(text)
        marks = [(float(c.get("cx")), float(c.get("cy"))) for c in drawing.iter("{http://www.w3.org/2000/svg}circle")
                 if float(c.get("cy")) > chart.TOP - 20]
        self.assertEqual(len(marks), 2)
        self.assertLess(marks[0][0], marks[1][0])
        self.assertLess(marks[0][1], marks[1][1])
        self.assertIn("a &lt;case&gt;", text)

    def test_a_failure_is_named_off_the_scale(self):
        text = chart.figure({"a": [point("elastix", "iterations", 10, 2.0), point("plastimatch", "iterations", 1, 20.0)]})
        self.assertIn("plastimatch: 20 mm in 1 core seconds", text)
        self.assertEqual(text.count(f'r="4" fill="{chart.COLOURS["plastimatch"]}"'), 1, "the legend's alone")

    def test_without_data_the_script_says_so(self):
        with tempfile.TemporaryDirectory() as folder:
            done = subprocess.run([SCRIPTS / "accuracy_time", "--data", folder, "--output", f"{folder}/out", "--case", "lung"],
                                  capture_output=True, text=True)
        self.assertEqual(done.returncode, 1)
        self.assertIn("give --data", done.stderr)


if __name__ == "__main__":
    unittest.main()
