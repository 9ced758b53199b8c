"""The head of data/brainshift registered from numpy arrays gives the same bits as the command line.

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

    def test_error_estimate(self):
        deviation, trust = self.result.error_image()
        numpy.testing.assert_array_equal(deviation.array.T, written("uncertainty.nii.gz"))
        numpy.testing.assert_array_equal(trust.array.T, written("uncertainty_trust.nii.gz"))


if __name__ == "__main__":
    unittest.main()
