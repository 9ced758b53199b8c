"""The head of data/brainshift registered from numpy arrays gives the same bits as the command line, whose fields leave
bone where it is.

TISSUEWARP_EDGE_LENGTH in mm; 0 is the program's own choice, which takes a minute.
"""

import json
import os
import pathlib
import subprocess
import tempfile
import unittest

HEAD = pathlib.Path(__file__).resolve().parents[2] / "data/brainshift"
EDGE = os.environ.get("TISSUEWARP_EDGE_LENGTH", "9")
FOLDER = tempfile.TemporaryDirectory()
OUTPUT = pathlib.Path(FOLDER.name) / "out"

PROGRAM = os.environ["TISSUEWARP"]
subprocess.run([PROGRAM, "register", "--moving", HEAD / "preop.nii.gz", "--moving-labels",
                HEAD / "preop_labels.nii.gz", "--fixed", HEAD / "intraop.nii.gz", "--fixed-labels",
                HEAD / "intraop_labels.nii.gz", "--edge-length", EDGE, "--device", "cpu", "--quiet", "--output",
                OUTPUT], check=True)
# The program tells OpenBLAS what the processor is where it does not know; here that must happen before it is loaded.
BLAS = json.loads((OUTPUT / "report.json").read_text())["versions"]["BLAS"].split()
if "OpenBLAS" in BLAS:
    os.environ["OPENBLAS_CORETYPE"] = BLAS[-2]  # "… SkylakeX MAX_THREADS=64"

import h5py
import nibabel
import numpy
import tissuewarp


def load(name):
    image = nibabel.load(HEAD / f"{name}.nii.gz")
    return tissuewarp.Image.from_affine(numpy.asarray(image.dataobj), image.affine)


def written(name):
    return numpy.asarray(nibabel.load(OUTPUT / name).dataobj)


class SameBits(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.addClassCleanup(FOLDER.cleanup)
        model = tissuewarp.prepare(load("preop_labels"), edge_length=float(EDGE))
        cls.result = tissuewarp.update(model, labels=load("intraop_labels"), grid=load("intraop"), device="cpu")

    def test_displacement_of_every_node(self):
        mesh = self.result.mesh
        with h5py.File(OUTPUT / "record.h5") as record:
            numpy.testing.assert_array_equal(record["mesh/nodes"][:], mesh.nodes)
            numpy.testing.assert_array_equal(record["displacement"][:], self.result.displacement)
            numpy.testing.assert_array_equal(record["placement"][:], self.result.placement)
        print(f"{len(mesh.tets)} tetrahedra: the same bits")

    def test_warped_image_and_labels(self):
        self.result.hold_surroundings(load("preop"), load("intraop"))
        warped = self.result.warp(load("preop"))
        numpy.testing.assert_array_equal(warped.array.T, written("warped.nii.gz"))
        labels = self.result.warp(load("preop_labels"), interpolation="nearest")
        numpy.testing.assert_array_equal(labels.array.T, written("warped_labels.nii.gz"))

    def test_bone_around_the_brain_stays(self):
        """Skull and scalp of the phantom did not move. What was aligned was the brain, half a degree beside them."""
        for field, image in (("moving_to_fixed", "preop"), ("fixed_to_moving", "intraop")):
            grey, labels = (numpy.asarray(nibabel.load(HEAD / f"{image}{kind}.nii.gz").dataobj) for kind in ("", "_labels"))
            near = labels > 0
            for _ in range(4):  # voxels of 1 mm
                near = near | numpy.any([numpy.roll(near, step, axis) for axis in range(3) for step in (-1, 1)], axis=0)
            bone = ~near & (grey > 0.3 * numpy.median(grey[labels > 0]))
            moved = numpy.linalg.norm(written(f"displacement_{field}.nii.gz").squeeze()[bone], axis=-1)
            self.assertGreater(moved.size, 1_000_000)
            print(f"{field}: bone and skin moved by {moved.mean():.4f} mm, {(moved > 0.1).mean():.2%} by more than 0.1 mm")
            self.assertLess(numpy.percentile(moved, 98), 0.1)  # what opened beside the brain is bright in places, too

    def test_error_estimate(self):
        deviation, trust = self.result.error_image()
        numpy.testing.assert_array_equal(deviation.array.T, written("uncertainty.nii.gz"))
        numpy.testing.assert_array_equal(trust.array.T, written("uncertainty_trust.nii.gz"))


if __name__ == "__main__":
    unittest.main()
