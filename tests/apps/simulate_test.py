"""The verbs simulate and explain: a scene from --init to its files, read with other software."""

import csv
import json
import pathlib
import tempfile
import unittest
import xml.etree.ElementTree

import h5py
import numpy

from phantom import run

SMALL_CUBE = """
[geometry]
box = { size_mm = [100, 100, 100], cells = [3, 3, 3] }
[label.1]
youngs_modulus_kpa = 3.0
poissons_ratio = 0.3
[set.base]
side = "-z"
[[fixed]]
set = "base"
[gravity]
to = [0, 0, -1]
[solve]
frames = 2
[[probe]]
name = "top"
at_mm = [50, 50, 100]
"""

FALLING_BLOCK = """
[geometry]
box = { size_mm = [40, 40, 20], cells = [3, 3, 2] }
[label.1]
youngs_modulus_kpa = 20
poissons_ratio = 0.4
[gravity]
to = [0, 0, -1]
curve = [[0, 1]]
"""


class Simulate(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-test-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.scene = self.folder / "scene.toml"
        self.scene.write_text(SMALL_CUBE)

    def require_described(self, xdmf, displacement):
        """Follows every reference of the description to a dataset of the shape it states."""
        grids = xml.etree.ElementTree.parse(xdmf).findall("Domain/Grid/Grid")
        self.assertEqual([float(grid.find("Time").get("Value")) for grid in grids], [0, 0.5, 1])
        for frame, grid in enumerate(grids):
            for item in grid.iter("DataItem"):
                if item.get("Format") != "HDF":
                    continue
                name, dataset = item.text.split(":")
                with h5py.File(xdmf.parent / name) as record:
                    self.assertEqual(record[dataset].shape, tuple(map(int, item.get("Dimensions").split())))
            slab, whole = grid.find("Attribute[@Name='displacement']/DataItem").findall("DataItem")
            start, stride, count = numpy.array(slab.text.split(), int).reshape(3, 3)
            self.assertEqual(count.tolist(), [1, *displacement.shape[1:]])
            self.assertEqual((start.tolist(), stride.tolist()), ([frame, 0, 0], [1, 1, 1]))
            self.assertEqual(whole.text, "displacement.h5:/displacement")

    def test_a_plane_has_no_end(self):
        """A block slides down by six times its length; it fell through where a quarter of that was sampled."""
        normal, point = numpy.array([0.2588190451, 0, 0.9659258263]), numpy.array([0, 0, -6])
        for friction, least_mm in ((0.0, 200), (0.1, 100)):
            self.scene.write_text(FALLING_BLOCK + f"""
[[contact]]
plane = {{ point_mm = {point.tolist()}, normal = {normal.tolist()} }}
friction = {friction}
[solve]
kind = "dynamics"
duration_s = 0.5
""")
            output = self.folder / f"friction_{friction}"
            result = run("simulate", self.scene, "--output", output, "--device", "cpu", "--quiet")
            self.assertEqual(result.returncode, 0, result.stderr)
            with h5py.File(output / "displacement.h5") as record:
                moved = record["displacement"][-1]
                place = record["mesh/nodes"][:] + moved
            self.assertGreater(numpy.linalg.norm(moved, axis=1).min(), least_mm)
            self.assertGreater(((place - point) @ normal).min(), -0.1)

    def test_tissue_that_falls_into_what_is_not_sampled_is_refused(self):
        corners = [(x, y, z) for z in (-260, -160) for y in (-60, 100) for x in (-60, 100)]
        faces = [(0, 2, 3), (0, 3, 1), (4, 5, 7), (4, 7, 6), (0, 1, 5), (0, 5, 4), (2, 6, 7), (2, 7, 3), (0, 4, 6),
                 (0, 6, 2), (1, 3, 7), (1, 7, 5)]
        lines = ["v %g %g %g" % each for each in corners] + ["f %d %d %d" % tuple(i + 1 for i in f) for f in faces]
        (self.folder / "table.obj").write_text("\n".join(lines) + "\n")
        self.scene.write_text(FALLING_BLOCK + """
[[contact]]
surface = "table.obj"
[solve]
kind = "dynamics"
duration_s = 0.24
frames = 8
""")
        output = self.folder / "out"
        result = run("simulate", self.scene, "--output", output, "--device", "cpu", "--quiet")
        self.assertNotEqual(result.returncode, 0)
        self.assertIn("passed into or through the body of contact 1", result.stderr)
        self.assertFalse(output.exists())

    def test_files_of_a_run(self):
        done = run("simulate", self.scene, "-o", self.folder / "out")
        self.assertEqual(done.returncode, 0, done.stderr)
        names = sorted(path.name for path in (self.folder / "out").iterdir())
        self.assertEqual(names, ["displacement.h5", "frame_0000.vtu", "frame_0001.vtu", "frame_0002.vtu", "frames.pvd",
                                 "frames.xdmf", "probes.csv", "summary.json"])
        with h5py.File(self.folder / "out" / "displacement.h5") as record:
            self.assertEqual(record.attrs["format"], "tissuewarp simulation")
            displacement = record["displacement"][:]
            nodes = record["mesh/nodes"][:]
            numpy.testing.assert_allclose(record["time"][:], [0, 0.5, 1])
        self.assertEqual(displacement.shape, (3, 64, 3))
        self.assertTrue((displacement[0] == 0).all())
        self.assertTrue((displacement[2][nodes[:, 2] == 0] == 0).all())
        self.require_described(self.folder / "out" / "frames.xdmf", displacement)
        rows = list(csv.DictReader((self.folder / "out" / "probes.csv").read_text().splitlines()))
        top = numpy.argmin(numpy.linalg.norm(nodes - [50, 50, 100], axis=1))
        self.assertEqual([row["time_s"] for row in rows], ["0", "0.5", "1"])
        self.assertLess(float(rows[2]["dz_mm"]), -10)
        self.assertLess(abs(float(rows[2]["dz_mm"]) - displacement[2][top, 2]), 1.5)
        summary = json.loads((self.folder / "out" / "summary.json").read_text())
        self.assertEqual(summary["frames"], 3)
        self.assertAlmostEqual(summary["largest_displacement_mm"],
                               float(numpy.linalg.norm(displacement[2], axis=1).max()), places=3)

    def test_init_writes_a_scene_that_runs(self):
        done = run("simulate", "--init", "cube", folder=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        done = run("simulate", "cube.toml", "-o", "out", folder=self.folder)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertTrue((self.folder / "out" / "frames.pvd").exists())
        again = run("simulate", "--init", "cube", folder=self.folder)
        self.assertEqual(again.returncode, 2)
        self.assertIn("there already", again.stderr)

    def test_every_init_writes_a_scene_that_runs_anywhere(self):
        for name in ["brain-shift", "breast", "liver", "resection", "retraction"]:
            done = run("simulate", "--init", name, folder=self.folder)
            self.assertEqual(done.returncode, 0, done.stderr)
            done = run("explain", name + ".toml", folder=self.folder)
            self.assertEqual(done.returncode, 0, done.stderr)
        again = run("simulate", "--init", "brain-shift", "brain-shift.labels.toml", folder=self.folder)
        self.assertEqual(again.returncode, 0, again.stderr)
        other = run("simulate", "--init", "brain-shift", folder=self.folder)
        self.assertEqual(other.returncode, 2)
        self.assertIn("there already", other.stderr)

    def test_init_of_an_unknown_scene(self):
        done = run("simulate", "--init", "brainshift", folder=self.folder)
        self.assertEqual(done.returncode, 2)
        self.assertIn("brain-shift", done.stderr)

    def test_wrong_scene_is_one_line_and_no_folder(self):
        self.scene.write_text(SMALL_CUBE.replace("frames", "framse"))
        done = run("simulate", self.scene, "-o", self.folder / "out")
        self.assertEqual(done.returncode, 2)
        self.assertEqual(len(done.stderr.strip().splitlines()), 1)
        self.assertIn("line 14", done.stderr)
        self.assertIn("'frames'", done.stderr)
        self.assertFalse((self.folder / "out").exists())

    def test_output_is_asked_for(self):
        done = run("simulate", self.scene)
        self.assertEqual(done.returncode, 2)
        self.assertIn("--output", done.stderr)

    def test_ablate_prints_each_effect(self):
        done = run("simulate", self.scene, "--ablate")
        self.assertEqual(done.returncode, 0, done.stderr)
        line = next(line for line in done.stdout.splitlines() if line.startswith("gravity"))
        self.assertGreater(float(line.split()[1]), 10)

    def test_explain_names_what_is_there_and_what_is_not(self):
        done = run("explain", self.scene)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn("162 linear tetrahedra", done.stdout)
        self.assertIn("+ gravity", done.stdout)
        absent = next(line for line in done.stdout.splitlines() if line.startswith("absent"))
        self.assertIn("contact", absent)
        self.assertNotIn("gravity", absent)


if __name__ == "__main__":
    unittest.main()
