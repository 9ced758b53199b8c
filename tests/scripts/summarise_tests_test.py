"""scripts/summarise_tests.py: what the last line of scripts/test says of a run of ctest."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

SCRIPT = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "summarise_tests.py"
SKIPPED = '<skipped message="SKIP_REGULAR_EXPRESSION_MATCHED"/>'


def case(name, status, inside=""):
    return f'<testcase name="{name}" status="{status}">{inside}</testcase>'


def skipped(name, why):
    return case(name, "notrun", f"{SKIPPED}<system-out>[ RUN ]\nx_test.cpp:24: Skipped\n{why}\n\n[  SKIPPED ]</system-out>")


class Summary(unittest.TestCase):
    def line(self, *cases):
        with tempfile.TemporaryDirectory() as folder:
            report = pathlib.Path(folder) / "tests.xml"
            report.write_text(f"<testsuite>{''.join(cases)}</testsuite>")
            done = subprocess.run([sys.executable, SCRIPT, report], capture_output=True, text=True, check=True)
            return done.stdout

    def test_it_counts(self):
        cases = case("A.One", "run"), case("A.Two", "run"), case("A.Three", "fail", '<failure message=""/>')
        self.assertEqual(self.line(*cases), "Tests: 2 passed, 1 failed, 0 skipped\n")

    def test_it_names_what_was_skipped_by_the_reason(self):
        cases = skipped("B.Lung", "for want of data"), skipped("C.Page", "no browser"), skipped("B.Head", "for want of data")
        self.assertEqual(self.line(*cases), "Tests: 0 passed, 0 failed, 3 skipped; 2 for want of data (B.Head, B.Lung); "
                                            "1 no browser (C.Page)\n")

    def test_a_program_that_is_not_there_has_failed(self):
        absent = case("D.Gone", "notrun", '<skipped message="Unable to find executable"/>')
        self.assertEqual(self.line(absent), "Tests: 0 passed, 1 failed, 0 skipped\n")


if __name__ == "__main__":
    unittest.main()
