"""scripts/main_job with programs that only pretend: what it prints, compares and refuses."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "main_job"

PROGRAM = """#!{python}
import gzip, json, pathlib, sys
output = pathlib.Path([a.split("=", 1)[1] for a in sys.argv if a.startswith("--output=")][0])
output.mkdir(exist_ok=True)
with gzip.open(output / "field.nii.gz", "wb", compresslevel={level}) as file:
    file.write({content!r})
summary = dict(mean=0.125)
report = dict(peak_memory_mb={megabytes}, stages=[dict(stage="meshing", seconds={seconds}), dict(stage="write", seconds=1)],
              target_registration_error=dict(all=dict(after=summary)))
(output / "report.json").write_text(json.dumps(report))
"""


class MainJob(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def program(self, name, seconds=2, megabytes=500, content=b"numbers", level=1):
        path = self.folder / name
        path.write_text(PROGRAM.format(python=sys.executable, seconds=seconds, megabytes=megabytes, content=content, level=level))
        path.chmod(0o755)
        return path

    def run_script(self, *arguments):
        return subprocess.run([SCRIPT, "--runs", "2", *map(str, arguments)], capture_output=True, text=True)

    def test_stages_stand_side_by_side(self):
        done = self.run_script(self.program("new"), "--against", self.program("old", seconds=5, megabytes=1000, level=9))
        self.assertEqual(done.returncode, 0, done.stderr)
        rows = {line[:20].strip(): line[20:].split() for line in done.stdout.splitlines()}
        self.assertEqual(rows["meshing"], ["2.00", "5.00"])
        self.assertEqual(rows["peak memory, MB"], ["500", "1000"])
        self.assertEqual(rows["mean error, mm"], ["0.1250", "0.1250"])
        self.assertIn("0.50 of memory", done.stdout)
        self.assertIn("numbers written: the same", done.stdout)

    def test_other_numbers_are_told(self):
        done = self.run_script(self.program("new"), "--against", self.program("old", content=b"others"))
        self.assertIn("numbers written: NOT the same", done.stdout)

    def test_limits_hold(self):
        program = self.program("new")
        self.assertEqual(self.run_script(program, "--most-megabytes", 500, "--most-seconds", 60).returncode, 0)
        refused = self.run_script(program, "--most-megabytes", 499)
        self.assertEqual(refused.returncode, 1)
        self.assertIn("499 MB", refused.stderr)

    def test_a_program_that_fails_is_named(self):
        refused = self.run_script("/bin/false")
        self.assertNotEqual(refused.returncode, 0)
        self.assertIn("/bin/false", refused.stderr)


if __name__ == "__main__":
    unittest.main()
