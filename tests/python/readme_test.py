"""The README's example runs as it stands, in no more than ten lines, and finds the tumour."""

import contextlib
import io
import os
import pathlib
import re
import tempfile
import unittest

import nibabel
import numpy

from phantom import ROOT

HEAD = ROOT / "data/brainshift"


class Readme(unittest.TestCase):
    def test_example(self):
        [example] = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
        self.assertLessEqual(len([line for line in example.splitlines() if line.strip()]), 10)
        names, before = {}, os.getcwd()
        with tempfile.TemporaryDirectory() as folder:
            for file in HEAD.glob("*.nii.gz"):
                (pathlib.Path(folder) / file.name).symlink_to(file)
            os.chdir(folder)
            try:
                with contextlib.redirect_stdout(io.StringIO()) as said:
                    exec(compile(example, "README.md", "exec"), names)
                warped = nibabel.load("warped.nii.gz")
                shown = numpy.asarray(warped.dataobj)
            finally:
                os.chdir(before)
        self.assertTrue(said.getvalue())
        moved = numpy.linalg.norm(names["tumour_now"] - names["tumour"])
        self.assertAlmostEqual(moved, 5.2, delta=0.3)  # the truth, landmarks.csv
        self.assertLess(names["within"][0], 2.0)
        fixed = nibabel.load(HEAD / "intraop.nii.gz")
        self.assertEqual(shown.shape, fixed.shape)
        numpy.testing.assert_allclose(warped.affine, fixed.affine, atol=1e-5)


if __name__ == "__main__":
    unittest.main()
