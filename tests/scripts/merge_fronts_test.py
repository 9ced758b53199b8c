"""scripts/merge_fronts.py: what several calibrations become, and what it refuses."""

import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "merge_fronts.py"


def fronts(rounds_s, machine="two cores", densities=(6.0, 8.0)):
    return {"schema_version": 3, "machine": machine, "warp": {"constant_s": rounds_s / 10, "slope_s": 0.1},
            "points": [{"data": "labels", "edges_per_organ": n, "rounds_s": n * rounds_s, "rounds_95_s": n * rounds_s,
                        "error_mm": rounds_s, "error_95_mm": rounds_s} for n in densities]}


class Merged(unittest.TestCase):
    def merge(self, *files, output="merged.json"):
        with tempfile.TemporaryDirectory() as folder:
            folder = pathlib.Path(folder)
            paths = [folder / f"{i}.json" for i in range(len(files))]
            for path, content in zip(paths, files):
                path.write_text(json.dumps(content))
            run = subprocess.run([sys.executable, SCRIPT, "--output", folder / output, *paths],
                                 capture_output=True, text=True)
            return run, (folder / output).read_text() if run.returncode == 0 else ""

    def test_medians_and_percentiles_over_files(self):
        run, text = self.merge(*(fronts(s) for s in (1.0, 2.0, 9.0)))
        self.assertEqual(run.returncode, 0, run.stderr)
        result = json.loads(text)
        self.assertEqual(result["warp"], {"constant_s": 0.2, "slope_s": 0.1})
        first, second = result["points"]
        self.assertEqual((first["rounds_s"], second["rounds_s"]), (12.0, 16.0))
        self.assertAlmostEqual(first["error_95_mm"], 8.3)
        self.assertAlmostEqual(second["rounds_95_s"], 8 * 8.3)

    def test_one_file_stays_as_it_is(self):
        run, text = self.merge(fronts(1.0))
        self.assertEqual(json.loads(text), fronts(1.0))

    def test_the_programs_own_figures_are_a_string(self):
        run, text = self.merge(fronts(1.0), output="shipped_fronts.cpp")
        self.assertIn("shipped_fronts_text = R\"json({", text)
        self.assertEqual(json.loads(text.split('R"json(')[1].split(')json"')[0]), fronts(1.0))

    def test_other_machines_and_missing_meshes_are_refused(self):
        run, _ = self.merge(fronts(1.0), fronts(1.0, machine="four cores"))
        self.assertNotEqual(run.returncode, 0)
        self.assertIn("four cores", run.stderr)
        run, _ = self.merge(fronts(1.0), fronts(1.0, densities=(6.0,)))
        self.assertNotEqual(run.returncode, 0)
        self.assertIn("8.0 edges from labels are in 1 of 2", run.stderr)


if __name__ == "__main__":
    unittest.main()
