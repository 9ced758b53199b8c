"""scripts/equilibrium_sweep: the table of rows that several runs have written."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "equilibrium_sweep"
HEADER = "kind,seed,tetrahedra,seconds,outcome,reason\n"


class Table(unittest.TestCase):
    def sum(self, *contents, more=()):
        with tempfile.TemporaryDirectory() as name:
            files = [pathlib.Path(name) / f"{i}.csv" for i in range(len(contents))]
            for file, content in zip(files, contents):
                file.write_text(HEADER + content)
            return subprocess.run([sys.executable, SCRIPT, *more, "--sum", *files], capture_output=True, text=True)

    def test_rows_of_all_files_count(self):
        run = self.sum('rod,1,2000,1.00,solved,\nrod,2,,3.00,right refusal,"inverted, as forced"\n',
                       "rod,3,5000,2.00,solved,\nbox,1,,60.00,not within the limit,\nbox,2,,1.00,wrong refusal,x\n")
        self.assertIn("| rod | 3 | 2 | 1 | 0 | 2.00 | 3.0 | 3.0 |", run.stdout)
        self.assertIn("| box | 2 | 0 | 0 | 2 | 30.50 | 60.0 | 60.0 |", run.stdout)
        self.assertIn("| all | 5 | 2 | 1 | 2 | 2.00 | 60.0 | 60.0 |", run.stdout)
        self.assertEqual(run.returncode, 4)

    def test_right_refusals_are_good_and_others_are_not(self):
        rows = "box,1,9,1.00,solved,\nbox,2,,1.00,right refusal,x\n"
        self.assertEqual(self.sum(rows).returncode, 0)
        self.assertEqual(self.sum(rows + "box,3,,1.00,refusal,x\n").returncode, 4)
        self.assertEqual(self.sum(rows + "box,3,,1.00,refusal,x\n", more=("--least", "60")).returncode, 0)


if __name__ == "__main__":
    unittest.main()
