"""--accuracy and --time-budget choose a mesh, say what they expect, and check it."""

import json
import os
import unittest
from unittest import mock

from phantom import PhantomTest, run

INPUT = 2


def measured(edges_per_organ, tetrahedra, rounds_s, error_mm):
    return {"data": "labels", "edges_per_organ": edges_per_organ, "tetrahedra": tetrahedra, "preparation_s": rounds_s,
            "rounds_s": rounds_s, "rounds_95_s": 2 * rounds_s, "fields_s": 0.05,
            "error_mm": error_mm, "error_95_mm": 2 * error_mm}


FRONTS = {"schema": "tissuewarp.fronts", "schema_version": 3, "machine": "a test",
          **{name: {"constant_s": 0.05, "slope_s": 0.1}
             for name in ("alignment_labels", "alignment_partial", "fields", "warp")},
          "points": [measured(6, 2000, 0.1, 2.0), measured(10, 10000, 0.5, 0.5)]}


def texts_of(report):
    return [doubt["text"] for doubt in report["doubts"]]


class Dial(PhantomTest):
    """By figures of its own: those of a machine or of the program are measured, and may choose otherwise."""

    def setUp(self):
        super().setUp()
        cache = self.phantom.folder / "cache"
        cache.mkdir()
        (cache / "fronts.json").write_text(json.dumps(FRONTS))
        patch = mock.patch.dict(os.environ, TISSUEWARP_CACHE=str(cache))
        patch.start()
        self.addCleanup(patch.stop)

    def registered(self, *options):
        result = self.phantom.register(*options)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("chosen: edges of", result.stdout)
        return json.loads((self.phantom.output / "report.json").read_text())

    def test_finer_for_more_accuracy(self):
        coarse, fine = (self.registered("--accuracy", f"{mm}mm")["dial"] for mm in (5, 0.01))
        self.assertEqual(coarse["accuracy_mm"], 5)
        self.assertGreater(coarse["edge_length_mm"], 1.3 * fine["edge_length_mm"])
        self.assertIn("not to be expected", fine["reason"])

    def test_shortfall_is_a_doubt(self):
        report = self.registered("--accuracy", "0.01")
        self.assertTrue(any("0.01 mm were asked for" in doubt for doubt in texts_of(report)), report["doubts"])

    def test_time_is_counted(self):
        report = self.registered("--time-budget", "60s")
        self.assertEqual(report["dial"]["time_budget_s"], 60)
        stages = {entry["stage"]: entry["seconds"] for entry in report["stages"]}
        counted = sum(stages[name] for name in ("rigid alignment", "boundary maps", "correspondence", "equilibrium",
                                                "unknown loads", "fields", "warp"))
        self.assertAlmostEqual(report["intraoperative_seconds"], counted, delta=0.2 * counted + 0.05)
        self.assertNotIn("time.exceeded", [doubt["code"] for doubt in report["doubts"]])

    def test_no_time_ends_the_rounds(self):
        report = self.registered("--time-budget", "1ms")
        self.assertEqual(len(report["rounds"]), 1)
        self.assertIn("time.exceeded", [doubt["code"] for doubt in report["doubts"]])

    def test_what_contradicts_is_refused(self):
        self.assert_refused(self.phantom.register("--accuracy", "0.5mm", "--edge-length", 4), INPUT, "--edge-length")
        self.assert_refused(self.phantom.register("--accuracy", "0.5kg"), INPUT, "--accuracy", "0.5kg")
        self.assert_refused(self.phantom.register("--time-budget", "-2s"), INPUT, "--time-budget", "-2s")
        self.assert_refused(self.phantom.register("--accuracy", 1, "--no-error-estimate"), INPUT, "--no-error-estimate")


class Calibrate(PhantomTest):
    def test_figures_are_measured_and_used(self):
        path = self.phantom.folder / "cache" / "fronts.json"
        result = run("calibrate", "--quick", "--device", "cpu", "--output", path)
        self.assertEqual(result.returncode, 0, result.stderr)
        fronts = json.loads(path.read_text())
        self.assertEqual(fronts["schema"], "tissuewarp.fronts")
        self.assertEqual(sorted({point["data"] for point in fronts["points"]}), ["labels", "partial"])
        for kind in ("labels", "partial"):
            few, many = sorted((p for p in fronts["points"] if p["data"] == kind), key=lambda p: p["tetrahedra"])
            self.assertGreater(many["tetrahedra"], 2 * few["tetrahedra"])
            self.assertGreater(few["error_mm"], 0.05)
            self.assertLess(many["error_mm"], 10)


if __name__ == "__main__":
    unittest.main()
