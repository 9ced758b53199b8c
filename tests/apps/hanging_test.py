"""Slender and soft tissue that hangs by its own weight, at tolerances from 1 to 0.01 mm, against Newton's method.

TISSUEWARP_HANGING_BOXES says how many random boxes are taken, 3 otherwise.
"""

import importlib.machinery
import importlib.util
import os
import pathlib
import subprocess
import tempfile
import unittest

import h5py
import numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["TISSUEWARP"]
TOLERANCES_MM = (1.0, 0.5, 0.1, 0.05, 0.01)

CANTILEVER = """
density_kg_m3 = 1050
[geometry]
box = { size_mm = [400, 80, 120], cells = [20, 4, 6] }
[label.1]
youngs_modulus_kpa = 180
poissons_ratio = 0.4
[set.end]
side = "-x"
[[fixed]]
set = "end"
[gravity]
to = [0, -1, 0]
"""

ELLIPSOID = """
[geometry]
edge_length_mm = 12
[[geometry.shape]]
ellipsoid = { centre_mm = [0, 0, 0], radii_mm = [90, 60, 45] }
[label.1]
youngs_modulus_kpa = 3
poissons_ratio = 0.45
[set.patch]
surface_of = 0
ball = { centre_mm = [0, 0, 45], radius_mm = 25 }
[[fixed]]
set = "patch"
[gravity]
to = [0, 0, -1]
"""


def random_box(seed):
    loader = importlib.machinery.SourceFileLoader("equilibrium_sweep", str(ROOT / "scripts" / "equilibrium_sweep"))
    sweep = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
    loader.exec_module(sweep)
    return sweep.scene("box", seed, (1000, 5000), PROGRAM)


class HangingTissue(unittest.TestCase):
    def displacement(self, scene, solve):
        with tempfile.TemporaryDirectory(prefix="tissuewarp-test-") as name:
            folder = pathlib.Path(name)
            (folder / "scene.toml").write_text(f'{scene}\n[solve]\nkind = "equilibrium"\n{solve}\n')
            run = subprocess.run([PROGRAM, "simulate", folder / "scene.toml", "--output", folder / "out", "--device", "cpu",
                                  "--quiet"], capture_output=True, text=True)
            self.assertEqual(run.returncode, 0, run.stderr)
            with h5py.File(folder / "out" / "displacement.h5") as record:
                return record["displacement"][-1].astype(float)

    def require_within_tolerances(self, scene):
        expected = self.displacement(scene, 'method = "newton"\nprecision = "float64"\nload_steps = 10\ntolerance_mm = 0.001')
        self.assertGreater(numpy.linalg.norm(expected, axis=1).max(), 1)
        for tolerance in TOLERANCES_MM:
            found = self.displacement(scene, f"tolerance_mm = {tolerance}")
            self.assertLess(numpy.linalg.norm(found - expected, axis=1).max(), tolerance, f"at {tolerance} mm")

    def test_a_cantilever(self):
        self.require_within_tolerances(CANTILEVER)

    def test_an_ellipsoid_held_at_a_patch(self):
        self.require_within_tolerances(ELLIPSOID)

    def test_random_boxes(self):
        slender = 1011  # of 200 mm, hangs by 500: a correction below 1 mm left it 1.2 mm off
        boxes = int(os.environ.get("TISSUEWARP_HANGING_BOXES", "3"))
        for seed in sorted({*range(1001, 1001 + boxes), slender}):
            with self.subTest(seed=seed):
                self.require_within_tolerances(random_box(seed))


if __name__ == "__main__":
    unittest.main()
