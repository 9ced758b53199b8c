"""scripts/compare on a small pair with a stand-in for the program; how runs are measured; the rigid baseline."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
from study import fields, measured, rigid_icp

AFFINE = numpy.diag([1.5, -1.5, 2.0, 1.0])
SHAPE = (32, 30, 28)
SHIFT = numpy.array([3.0, -2.0, 1.0])  # mm, moving -> fixed

# Writes the fields of a pure shift, as the program would, and counts how often it was called.
STAND_IN = f"""#!/usr/bin/python3
import pathlib, sys
sys.path.insert(0, {str(SCRIPTS)!r})
import numpy
from study import fields
output = pathlib.Path(sys.argv[sys.argv.index("--output") + 1])
with open(pathlib.Path(__file__).with_name("calls"), "a") as calls:
    calls.write("called\\n")
affine, shift = numpy.diag([1.5, -1.5, 2.0, 1.0]), numpy.array([3.0, -2.0, 1.0])
for name, sign in (("moving_to_fixed", 1.0), ("fixed_to_moving", -1.0)):
    fields.write_field(output / f"displacement_{{name}}.nii.gz", numpy.broadcast_to(sign * shift, (32, 30, 28, 3)), affine)
"""


def make_liver(folder):
    """The files that the case "liver, labels" reads: a block that shifts."""
    folder.mkdir(parents=True)
    points = fields.grid_points(SHAPE, AFFINE)
    centre = points.mean(axis=0)
    for name, place in (("preop", centre), ("intraop", centre + SHIFT)):
        labels = (numpy.abs(points - place).max(axis=1) < 12.0).reshape(SHAPE).astype(numpy.uint8)
        fields.write_image(folder / f"{name}_labels.nii.gz", labels, AFFINE)
        fields.write_image(folder / f"{name}.nii.gz", 100 * labels, AFFINE)
    moving = centre + numpy.array([[0.0, 0.0, 0.0], [5.0, -5.0, 3.0]])
    rows = [",".join(map(str, [*m, *(m + SHIFT), 1])) for m in moving]
    (folder / "landmarks.csv").write_text("\n".join(["pre_x,pre_y,pre_z,intra_x,intra_y,intra_z,label", *rows]) + "\n")


class Compare(unittest.TestCase):
    def test_it_scores_and_resumes(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            make_liver(folder / "data" / "phantom-liver")
            program = folder / "stand-in"
            program.write_text(STAND_IN)
            program.chmod(0o755)

            def compare(*more):
                done = subprocess.run(
                    [sys.executable, SCRIPTS / "compare", "--data", folder / "data", "--output", folder / "out", "--program",
                     program, "--case", "liver, labels", "--tool", "tissuewarp", *more], capture_output=True, text=True)
                self.assertEqual(done.returncode, 0, done.stderr)
                return [row for row in done.stdout.splitlines() if row.startswith("| liver")]

            calls = lambda: len((folder / "calls").read_text().splitlines())
            before, after = compare()
            self.assertIn("3.74 / 3.74 / 3.74 / 3.74", before)  # the length of the shift
            self.assertIn("0.00 / 0.00 / 0.00 / 0.00 | 0 / 0", after)
            self.assertEqual(compare(), [before, after])
            self.assertEqual(calls(), 1, "a finished run was run again")
            compare("--again")
            self.assertEqual(calls(), 2)
            (folder / "data" / "phantom-liver" / "intraop_labels.nii.gz").write_bytes(
                (folder / "data" / "phantom-liver" / "preop_labels.nii.gz").read_bytes())
            compare()
            self.assertEqual(calls(), 3, "the result of another input was taken for this one's")
            program.write_text("#!/bin/sh\nexit 4\n")
            self.assertIn("stand-in ended with 4", compare("--again")[1])


class Measured(unittest.TestCase):
    def test_memory_is_the_programs_own(self):
        held = numpy.ones(60_000_000)  # 480 MB of this process, which Linux would count as the child's peak
        with tempfile.TemporaryDirectory() as folder:
            took = measured.run([sys.executable, "-S", "-c", "block = bytearray(b'x') * 150_000_000"], pathlib.Path(folder) / "log")
        self.assertEqual(held[0], 1.0)
        self.assertGreater(took["peak_mb"], 143.0)
        self.assertLess(took["peak_mb"], 250.0)

    def test_a_program_past_its_limit_is_ended(self):
        with tempfile.TemporaryDirectory() as folder:
            took = measured.run(["sleep", "30"], pathlib.Path(folder) / "log", limit_seconds=0.3)
        self.assertEqual(took["exit_code"], -9)
        self.assertLess(took["seconds"], 20.0)

    def test_core_seconds_count_all_processes(self):
        burn = "import os\npid = os.fork()\nwhile os.times().user < 0.4: pass\nif pid: os.wait()"
        with tempfile.TemporaryDirectory() as folder:
            took = measured.run([sys.executable, "-S", "-c", burn], pathlib.Path(folder) / "log")
        self.assertEqual(took["exit_code"], 0)
        self.assertGreater(took["cpu_seconds"], 0.75)


class RigidBaseline(unittest.TestCase):
    def test_it_finds_a_rigid_motion_from_half_a_surface_with_outliers(self):
        shape, affine = (60, 56, 40), numpy.diag([1.0, -1.0, 1.5, 1.0])
        points = fields.grid_points(shape, affine)
        centre = points.mean(axis=0)
        body = (((points - centre) / [24.0, 18.0, 20.0]) ** 2).sum(axis=1) < 1.0
        corner = numpy.all(points - centre > [2.0, -30.0, 1.0], axis=1)  # a cut octant breaks the symmetry
        labels = (body & ~corner).reshape(shape).astype(numpy.uint8)
        surface = rigid_icp.organ_surface(labels, affine)
        angle = numpy.radians(5.0)
        turn = numpy.array([[numpy.cos(angle), -numpy.sin(angle), 0.0], [numpy.sin(angle), numpy.cos(angle), 0.0], [0, 0, 1.0]])
        seen = surface[(surface - centre)[:, 0] > -5.0][::3]
        random = numpy.random.default_rng(3)
        intraop = (seen - centre) @ turn.T + centre + [3.0, -2.0, 2.0] + random.normal(0.0, 0.3, seen.shape)
        intraop[:len(intraop) // 20] += 15.0  # one in twenty is an outlier
        rotation, translation = rigid_icp.icp(intraop, surface)
        test = centre + numpy.array([[10.0, 0, 0], [0, -10.0, 0], [0, 0, 12.0], [-15.0, 5.0, 0]])
        carried = ((test - centre) @ turn.T + centre + [3.0, -2.0, 2.0]) @ rotation.T + translation
        self.assertLess(numpy.linalg.norm(carried - test, axis=1).max(), 0.5)


if __name__ == "__main__":
    unittest.main()
