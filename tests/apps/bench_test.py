"""`tissuewarp bench` on meshes that take a second: what it writes, not how fast it is."""

import csv
import json
import math
import re
import signal
import subprocess
import unittest
import xml.etree.ElementTree as xml

from phantom import PROGRAM, Phantom, PhantomTest, run

INPUT, IO, GPU = 2, 3, 5
ENGINES = ["scalar", "simd", "render-passes", "two-pass", "fused"]


class Benchmark(unittest.TestCase):
    """One quick run over everything, that all methods look at."""

    @classmethod
    def setUpClass(cls):
        cls.phantom = Phantom()
        cls.output = cls.phantom.folder / "bench"
        cls.result = run("bench", "--quick", "--repeats", 3, "--labels", cls.phantom.moving_labels, "--label", "1,2",
                         "--output", cls.output)
        cls.report = json.loads((cls.output / "bench.json").read_text()) if cls.result.returncode == 0 else None

    @classmethod
    def tearDownClass(cls):
        cls.phantom.temporary.cleanup()

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)

    def timings(self):
        for study in self.report["studies"]:
            for mesh in study["meshes"]:
                for engine in mesh["engines"]:
                    yield study["study"], mesh, engine

    # A study or an engine that is lost on the way leaves a gap in the figures.
    def test_every_study_times_every_engine(self):
        self.assertEqual(self.report["schema"], "tissuewarp.bench")
        self.assertEqual([study["study"] for study in self.report["studies"]], ["cube", "brain", "scaling"])
        for study in self.report["studies"]:
            self.assertGreaterEqual(len(study["meshes"]), 1)
            for mesh in study["meshes"]:
                self.assertEqual([engine["engine"] for engine in mesh["engines"]], ENGINES)
        self.assertEqual([mesh["elements"] for mesh in self.report["studies"][0]["meshes"]], [750, 3072])
        self.assertAlmostEqual(self.report["studies"][1]["meshes"][0]["elements"], 1500, delta=150)

    # An interpolation between the wrong meshes, or of the brain, whose elements are not those of a cube.
    def test_largest_cube_in_real_time_lies_between_its_neighbours(self):
        for name in ENGINES:
            factors = sorted((mesh["elements"], engine["real_time_factor"]) for study, mesh, engine in self.timings()
                             if engine["engine"] == name and study != "brain")
            limit = self.report["largest_real_time_cube"][name]
            slow = [elements for elements, factor in factors if factor < 1]
            if not slow:
                self.assertEqual((limit["kind"], limit["elements"]), ("above", factors[-1][0]))
            elif slow[0] == factors[0][0]:
                self.assertEqual((limit["kind"], limit["elements"]), ("below", factors[0][0]))
            else:
                self.assertEqual(limit["kind"], "interpolated")
                before = max(elements for elements, _ in factors if elements < slow[0])
                self.assertTrue(before <= limit["elements"] <= slow[0])

    # A wrong median, a share per node in place of per element, a ratio upside down.
    def test_numbers_follow_from_each_other(self):
        for _, mesh, engine in self.timings():
            runs = engine["seconds_per_step"]
            self.assertEqual(len(runs), 3)
            median = engine["median_seconds_per_step"]
            self.assertAlmostEqual(median, sorted(runs)[1], delta=1e-12)
            self.assertAlmostEqual(engine["mean_seconds_per_step"], sum(runs) / 3, delta=1e-9 * sum(runs))
            scalar = mesh["engines"][0]["median_seconds_per_step"]
            self.assertAlmostEqual(engine["ratio_to_scalar"], scalar / median, delta=1e-9 * scalar / median)
            self.assertAlmostEqual(engine["nanoseconds_per_element_step"] * mesh["elements"], median * 1e9,
                                   delta=1e-3 * median * 1e9)
            self.assertAlmostEqual(mesh["time_step_seconds"], 0.9 * mesh["critical_step_seconds"], delta=1e-12)
            self.assertAlmostEqual(engine["real_time_factor"] * median, mesh["time_step_seconds"], delta=1e-12)
            ceilings = self.report["ceilings"]["cpu" if engine["engine"] in ENGINES[:2] else "gpu"]
            rate = engine["bytes_per_element_step"] * mesh["elements"] / median
            self.assertAlmostEqual(engine["copy_bandwidth_share"] * ceilings["copy_bytes_per_second"], rate,
                                   delta=1e-6 * rate)
            rate = engine["flops_per_element_step"] * mesh["elements"] / median
            self.assertAlmostEqual(engine["fma_rate_share"] * ceilings["fma_flops_per_second"], rate, delta=1e-6 * rate)

    # An engine that is timed on another scene, or whose steps are not those that were timed.
    def test_results_were_compared(self):
        for _, _, engine in self.timings():
            self.assertEqual(engine["compared_steps"], 50)
            self.assertTrue(engine["repeats_equal"])
            self.assertTrue(engine["correct"])
            self.assertLess(engine["relative_difference"], 1e-4)
            self.assertGreater(engine["relative_difference"], 0, "float32 is not float64: was it compared with itself?")

    # The highest frequency goes with one over the edge: 5 and 8 cells.
    def test_critical_step_follows_the_edge(self):
        coarse, fine = self.report["studies"][0]["meshes"]
        self.assertAlmostEqual(coarse["critical_step_seconds"] / fine["critical_step_seconds"], 8 / 5, delta=0.1)

    def test_table_holds_every_row(self):
        for _, mesh, engine in self.timings():
            self.assertRegex(self.result.stdout, rf"(?m)^ *{mesh['elements']}  {engine['engine']} ")
            if engine["engine"] == "fused":
                shape = engine["step_shape"]
                names = ("patch_tets", "longest_fan", "workgroup")
                self.assertIn("  " + ":".join(str(shape[name]) for name in names), self.result.stdout)
        self.assertRegex(self.result.stdout, r"copy [\d.]+ GB/s, multiply-adds [\d.]+ Gflop/s")
        self.assertIn("largest cube in real time, scalar:", self.result.stdout)

    def test_csv_holds_the_same_numbers(self):
        with open(self.output / "bench.csv", newline="") as file:
            rows = list(csv.DictReader(file))
        timings = list(self.timings())
        self.assertEqual(len(rows), len(timings))
        for row, (study, mesh, engine) in zip(rows, timings):
            self.assertEqual((row["study"], row["engine"]), (study, engine["engine"]))
            self.assertEqual(int(row["elements"]), mesh["elements"])
            self.assertTrue(math.isclose(float(row["median_s"]), engine["median_seconds_per_step"], rel_tol=1e-5))

    # A curve without its points, a coordinate outside of the picture or not a number.
    def test_figures_hold_a_curve_for_each_engine(self):
        for study in self.report["studies"]:
            root = xml.parse(self.output / (study["study"] + ".svg")).getroot()
            width, height = (float(root.get(name)) for name in ("width", "height"))
            curves = root.findall("{http://www.w3.org/2000/svg}polyline")
            self.assertGreaterEqual(len(curves), 2 * len(ENGINES))
            for curve in curves:
                points = [tuple(map(float, point.split(","))) for point in curve.get("points").split()]
                self.assertEqual(len(points), len(study["meshes"]))
                for x, y in points:
                    self.assertTrue(0 < x < width and 0 < y < height)


class BenchmarkOptions(PhantomTest):
    # Engines of a device where there is none: left out and said, not failed.
    def test_cpu_alone(self):
        output = self.phantom.folder / "bench"
        result = run("bench", "--quick", "--study", "cube", "--elements", 384, "--device", "cpu", "--output", output)
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((output / "bench.json").read_text())
        self.assertEqual([e["engine"] for e in report["studies"][0]["meshes"][0]["engines"]], ENGINES[:2])
        self.assertIsNone(report["gpu"])
        self.assertIn("engine fused needs an OpenGL device", " ".join(report["notes"]))
        self.assertFalse((output / "brain.svg").exists())

    def test_engines_and_sizes_that_were_asked_for(self):
        result = run("bench", "--quick", "--study", "scaling", "--engines", "simd", "--elements", "1296,384")
        self.assertEqual(result.returncode, 0, result.stderr)
        rows = re.findall(r"(?m)^ *(\d+)  ([a-z-]+) ", result.stdout)
        self.assertEqual(rows, [("384", "simd"), ("1296", "simd")])

    def test_unknown_engine(self):
        self.assert_refused(run("bench", "--engines", "simd,warp"), INPUT, "'warp'", "two-pass")

    def test_engine_of_a_device_on_the_cpu(self):
        self.assert_refused(run("bench", "--engines", "fused", "--device", "cpu"), INPUT, "fused", "--device cpu")

    def test_sizes_without_a_study(self):
        self.assert_refused(run("bench", "--elements", "6000"), INPUT, "--elements", "--study")

    def test_size_that_is_no_mesh(self):
        self.assert_refused(run("bench", "--study", "cube", "--elements", "3"), INPUT, "--elements", "3")

    def test_one_run_cannot_be_compared(self):
        self.assert_refused(run("bench", "--repeats", "1"), INPUT, "--repeats")

    def test_brain_without_labels(self):
        result = run("bench", "--study", "brain", folder=self.phantom.folder)
        self.assert_refused(result, INPUT, "--labels")

    def test_label_that_is_absent(self):
        self.assert_refused(run("bench", "--study", "brain", "--labels", self.phantom.moving_labels, "--label", 7),
                            INPUT, "7", "moving_labels.nii.gz")

    def test_gpu_that_is_not_there(self):
        self.assert_refused(run("bench", "--device", "gpu:99"), GPU)

    # The folder appears before the first run and must go again; a run of an hour must stop within seconds.
    def test_interrupt_leaves_nothing(self):
        process = subprocess.Popen(
            [PROGRAM, "bench", "--study", "cube", "--elements", "6000", "--repeats", "1000", "--device", "cpu",
             "--output", str(self.phantom.output)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not self.phantom.output.exists() and process.poll() is None:
            pass
        process.send_signal(signal.SIGINT)
        printed, message = process.communicate(timeout=100)
        self.assertEqual(process.returncode, 130, message)
        self.assertEqual(message.count("\n"), 1, message)
        self.assertNotIn("cube", printed)  # what was measured before a study is already there
        self.assertFalse(self.phantom.output.exists())

    def test_output_is_a_file(self):
        path = self.phantom.folder / "taken"
        path.write_text("")
        self.assert_refused(run("bench", "--quick", "--output", path), IO, "taken")


if __name__ == "__main__":
    unittest.main()
