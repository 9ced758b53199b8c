"""A small pair of label maps and images with a known motion, and how to run the program on it."""

import os
import pathlib
import re
import subprocess
import tempfile
import unittest

import nibabel
import numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["TISSUEWARP"]
SHIFT_LPS = numpy.array([2.0, -1.5, 1.0])  # mm, of the centre
SIZE = 48
MOVING_AXES = numpy.array([15.0, 12.0, 12.0])  # mm, along L, P, S
FIXED_AXES = numpy.array([13.8, 13.0, 12.0])

# Voxel to RAS mm. The fixed image counts its first two axes the other way, as scanners do.
MOVING_AFFINE = numpy.array([[-1.0, 0, 0, 30], [0, -1, 0, 20], [0, 0, 1, -10], [0, 0, 0, 1]])
FIXED_AFFINE = numpy.array([[1.0, 0, 0, -17], [0, 1, 0, -27], [0, 0, 1, -10], [0, 0, 0, 1]])
CENTRE_LPS = numpy.array([-6.0, 4.0, 14.0])  # mm


def lps_of_voxels(affine, shape=(SIZE, SIZE, SIZE)):
    index = numpy.stack(numpy.meshgrid(*[numpy.arange(n) for n in shape], indexing="ij"), axis=-1)
    return (index @ affine[:3, :3].T + affine[:3, 3]) * [-1, -1, 1]


def ellipsoid(affine, centre, axes, shape=(SIZE, SIZE, SIZE)):
    """Labels (1 with a core of 2) and a grey image that varies inside."""
    scaled = (lps_of_voxels(affine, shape) - centre) / axes
    radius = numpy.linalg.norm(scaled, axis=-1)
    labels = (radius < 1).astype(numpy.uint8) + (radius < 0.45).astype(numpy.uint8)
    grey = numpy.where(radius < 1, 100 + 40 * scaled[..., 0], 10).astype(numpy.float32)
    return labels, grey


def save(array, affine, path):
    image = nibabel.Nifti1Image(array, affine)
    image.header.set_xyzt_units("mm")
    nibabel.save(image, str(path))
    return path


class Phantom:
    """Files of one pair in a folder of its own."""

    def __init__(self):
        self.temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-test-")
        self.folder = pathlib.Path(self.temporary.name)
        self.moving_labels_array, self.moving_array = ellipsoid(MOVING_AFFINE, CENTRE_LPS, MOVING_AXES)
        self.fixed_labels_array, self.fixed_array = ellipsoid(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, FIXED_AXES)
        self.moving = save(self.moving_array, MOVING_AFFINE, self.folder / "moving.nii.gz")
        self.moving_labels = save(self.moving_labels_array, MOVING_AFFINE, self.folder / "moving_labels.nii.gz")
        self.fixed = save(self.fixed_array, FIXED_AFFINE, self.folder / "fixed.nii.gz")
        self.fixed_labels = save(self.fixed_labels_array, FIXED_AFFINE, self.folder / "fixed_labels.nii.gz")
        self.output = self.folder / "out"

    def register(self, *more, **replaced):
        """Runs `register` on the pair; keyword arguments replace its files or, when None, drop them."""
        files = {name: getattr(self, name) for name in ("moving", "moving_labels", "fixed", "fixed_labels", "output")}
        files.update(replaced)
        arguments = ["register"]
        for name, path in files.items():
            if path is not None:
                arguments += ["--" + name.replace("_", "-"), str(path)]
        return run(*arguments, *more)


def run(*arguments, folder=None, timeout=110, **environment):
    """The program with these arguments, in that folder, with these variables besides those of the test."""
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=timeout, cwd=folder,
                          env={**os.environ, **environment})


class PhantomTest(unittest.TestCase):
    def setUp(self):
        self.phantom = Phantom()
        self.addCleanup(self.phantom.temporary.cleanup)

    def assert_refused(self, result, code, *words):
        """One line on standard error with these words and a page that is there, this exit code, and nothing left behind."""
        self.assertEqual(result.returncode, code, result.stderr)
        self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
        self.assertTrue(result.stderr.startswith("tissuewarp"), result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)
        page = re.search(r"docs/[\w/-]+\.md", result.stderr)
        self.assertTrue(code not in (2, 3, 4, 5) or page and (ROOT / page[0]).is_file(), f"names no page: {result.stderr}")
        self.assertEqual(result.stdout, "")
        self.assertFalse(self.phantom.output.is_dir(), "an output folder was left behind")
