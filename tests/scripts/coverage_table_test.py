"""scripts/coverage_table: what failed, what was doubted and for what, on tables made by hand."""

import contextlib
import importlib.machinery
import importlib.util
import io
import pathlib
import sys
import tempfile
import unittest

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
loader = importlib.machinery.SourceFileLoader("coverage_table", str(SCRIPTS / "coverage_table"))
coverage_table = importlib.util.module_from_spec(importlib.util.spec_from_loader("coverage_table", loader))
loader.exec_module(coverage_table)

COLUMNS = ("seed", "evidence", "doubt_codes", "error_x", "error_y", "error_z", "in_view", "interval", "trust",
           "xx", "yy", "zz", "xy", "yz", "zx", "cavity_dice", "least_det_j")


def written(folder, seed, rows, dice=-1, least_det_j=0.8):
    """Rows of (evidence, codes, error along x, in view, radius)."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [",".join(COLUMNS)]
    for evidence, codes, error, in_view, radius in rows:
        lines.append(f"{seed},{evidence},{codes},{error},0,0,{in_view},{radius},1,1,1,1,0,0,0,{dice},{least_det_j}")
    (folder / f"phantom_{seed}.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")


class CoverageTable(unittest.TestCase):
    def printed(self, *arguments):
        out, before = io.StringIO(), sys.argv
        sys.argv = ["coverage_table", *map(str, arguments)]
        try:
            with contextlib.redirect_stdout(out):
                coverage_table.main()
        finally:
            sys.argv = before
        return out.getvalue()

    def test_failures_and_doubts(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name) / "phantom"
            good, off = ("labels", "", 1, 1, 2), ("labels", "placement.loose data.contradict", 12, 1, 2)
            written(folder, 1, [good] * 20)
            written(folder, 2, [off] * 20)  # beyond 10 mm
            written(folder, 3, [("labels", "", 5, 1, 2)] * 20)  # beyond twice the radius, and nothing says so
            written(folder, 4, [("labels", "placement.loose", 1, 1, 2)] * 20)
            text = self.printed(folder)
        self.assertIn("4 registrations: 2 failed, 1 of these doubted; 2 did not, 1 of these doubted (50.0 %)", text)
        self.assertIn("| `placement.loose` | 1 | 1 |", text)
        self.assertIn("| `data.contradict` | 1 | 0 |", text)
        self.assertIn("| labels | 4 | 4.75 | 12.00 | 2.00 | 50.0 |", text)

    def test_folds_and_holes(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name) / "resected"
            written(folder, 1, [("image", "", 1, 1, 2)] * 10, dice=0.9)
            written(folder, 2, [("image", "", 1, 1, 2)] * 10, dice=0.7, least_det_j=-0.1)
            written(folder, 3, [("labels", "", 1, 1, 2)] * 10)
            text = self.printed(folder)
        self.assertIn("least det J -0.10; 1 of 3 registrations fold; Dice of the hole 0.800, least 0.70, of 2", text)

    def test_places_out_of_view_have_a_line_of_their_own(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name) / "bent"
            written(folder, 7, [("partial-image", "", 1, 1, 2)] * 10 + [("partial-image", "", 3, 0, 2)] * 10)
            text = self.printed(folder)
        self.assertIn("| partial-image | 1 | 1.00 |", text)
        self.assertIn("| partial-image, out of view | 1 | 3.00 |", text)
        self.assertIn("1 registrations: 0 failed", text)

    def test_drawn_errors_are_of_the_stated_size(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name) / "organ"
            written(folder, 7, [("labels", "", 50, 1, 2.8)] * 400)
            text = self.printed("--drawn", folder)
        self.assertIn("| labels | 1 | 1.", text)  # √(8/π) of a deviation of 1 mm

    def test_two_families_of_the_same_patients(self):
        with tempfile.TemporaryDirectory() as name:
            folder = pathlib.Path(name)
            for seed, error, other in ((1, 2, 1), (2, 3, 3), (3, 9, None)):
                written(folder / "resected", seed, [("image", "", error, 1, 5)] * 10)
                if other:
                    written(folder / "unresected", seed, [("image", "", other, 1, 5)] * 10)
            text = self.printed(folder / "resected", "--against", folder / "unresected")
        self.assertIn("image: 2 patients of both, 2.500 mm over 2.000 mm is 1.25; of single patients 1.50 in the median, 1 above 1.3",
                      text)


if __name__ == "__main__":
    unittest.main()
