"""The notebook runs from top to bottom, but for its picture, and finds the landmarks."""

import contextlib
import io
import json
import os
import re
import tempfile
import unittest

from phantom import ROOT

os.environ["TISSUEWARP_HEAD"] = str(ROOT / "data/brainshift")


class Notebook(unittest.TestCase):
    def test_brain_shift(self):
        cells = json.loads((ROOT / "docs/notebooks/brain_shift.ipynb").read_text())["cells"]
        names, before = {}, os.getcwd()
        with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(io.StringIO()) as said:
            os.chdir(folder)
            try:
                for number, cell in enumerate(cells):
                    if cell["cell_type"] == "code" and "picture" not in cell["metadata"].get("tags", []):
                        exec(compile("".join(cell["source"]), f"cell {number}", "exec"), names)
            finally:
                os.chdir(before)
        shift, left, within = map(float, re.findall(r"[0-9.]+", said.getvalue()))
        self.assertAlmostEqual(shift, 1.51, delta=0.01)
        self.assertLess(left, 0.3)
        self.assertGreater(within, 90)


if __name__ == "__main__":
    unittest.main()
