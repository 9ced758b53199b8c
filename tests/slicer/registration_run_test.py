"""What the module of 3D Slicer does apart from 3D Slicer: command lines, progress, doubts, choices of files."""

import json
import os
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "slicer" / "TissueWarp"))
from TissueWarpLib.registration_run import (RegistrationRun, Results, RunError, command_line, find_program,  # noqa: E402
                                            parse_progress, require_complete, segment_order)


class CommandLine(unittest.TestCase):
    def test_options_files_and_what_is_written(self):
        command = command_line("tissuewarp", {"fixed": "f.nrrd", "moving": "m.nrrd"}, "run", "--edge-length 6 --bids 'a b'")
        self.assertEqual(command, ["tissuewarp", "register", "--moving", "m.nrrd", "--fixed", "f.nrrd", "--output",
                                   "run/out", "--write", "organ", "--returnparameterfile", "run/returned.params",
                                   "--edge-length", "6", "--bids", "a b"])

    def test_markups_are_written_where_there_are_landmarks(self):
        files = dict.fromkeys(["moving", "fixed", "landmarks-moving", "landmarks-fixed"], "x")
        self.assertIn("organ,markups", command_line("tissuewarp", files, "run"))

    def test_what_cannot_be_run_is_said_before(self):
        for inputs, words in [({"fixed"}, "where the organ is"), ({"moving"}, "nothing to register to"),
                              ({"moving", "fixed-labels", "landmarks-moving"}, "'landmarks-fixed' is not"),
                              ({"moving", "fixed-points"}, "'moving-points' is not")]:
            with self.assertRaisesRegex(RunError, words):
                require_complete(dict.fromkeys(inputs))
        with self.assertRaisesRegex(RunError, "close the quotes"):
            command_line("tissuewarp", {"moving": "m", "fixed": "f"}, "run", "--bids 'a")

    def test_the_program_is_named_installed_or_on_the_path(self):
        self.assertEqual(find_program(sys.executable), sys.executable)
        with self.assertRaisesRegex(RunError, "'/nowhere' is no program"):
            find_program("/nowhere")
        with tempfile.TemporaryDirectory() as prefix:
            module = pathlib.Path(prefix, "share", "tissuewarp", "slicer", "TissueWarp")
            installed = pathlib.Path(prefix, "bin", "tissuewarp")
            for path in (module, installed.parent):
                path.mkdir(parents=True)
            installed.touch()
            self.assertEqual(find_program("", module), str(installed.resolve()))


class Segments(unittest.TestCase):
    def test_a_name_has_one_label_in_both_maps(self):
        self.assertEqual(segment_order(["skin", "brain", "tumour"], ["tumour", "probe", "brain"]),
                         (["brain", "tumour", "skin"], ["brain", "tumour"]))
        self.assertEqual(segment_order(["b", "a"], None), (["b", "a"], []))

    def test_names_that_do_not_match_are_refused(self):
        with self.assertRaisesRegex(RunError, r"moving: brain; fixed: cerebrum\); name the same tissue alike"):
            segment_order(["brain"], ["cerebrum"])
        with self.assertRaisesRegex(RunError, "two segments of the moving image are called 'brain'"):
            segment_order(["brain", "brain"], ["brain"])


class Progress(unittest.TestCase):
    def test_the_last_word_counts(self):
        text = ("<filter-start>\n<filter-name>reading</filter-name>\n</filter-start>\n<filter-progress>0.02</filter-progress>\n"
                "<filter-start>\n<filter-name>registering</filter-name>\n</filter-start>\n<filter-progress>0.31</filter-progress>\n<filter-pro")
        self.assertEqual(parse_progress(text), (0.31, "registering"))
        self.assertEqual(parse_progress(""), (0.0, None))


class Runs(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def run_python(self, program):
        return RegistrationRun([sys.executable, "-c", program], self.folder)

    def test_a_failure_is_told_in_the_programs_words(self):
        run = self.run_python("import sys; print('tissuewarp register: no such file', file=sys.stderr); sys.exit(3)")
        run.wait(20)
        with self.assertRaisesRegex(RunError, "^tissuewarp register: no such file$"):
            run.results()

    def test_cancelled(self):
        run = self.run_python("import time; print('<filter-progress>0.5</filter-progress>', flush=True); time.sleep(60)")
        while run.poll()[0] < 0.5:
            self.assertTrue(run.poll()[2])
        run.cancel()
        run.wait(20)
        with self.assertRaisesRegex(RunError, "cancelled"):
            run.results()

    def write_report(self, doubts):
        (self.folder / "report.json").write_text(json.dumps({"doubts": doubts}))

    def test_doubts_are_red_and_escaped(self):
        (self.folder / "transform.h5").touch()
        self.write_report([{"code": "labels.turned", "severity": "doubt", "text": "30 < 40", "remedy": "look"},
                           {"code": "time.exceeded", "severity": "notice", "text": "late", "remedy": ""}])
        doubt, notice = Results(self.folder).doubts_html().split("</p>")[:2]
        self.assertIn("#c00000", doubt)
        self.assertIn("30 &lt; 40; look <i>(labels.turned)</i>", doubt)
        self.assertNotIn("#c00000", notice)
        self.write_report([])
        self.assertIn("No doubts", Results(self.folder).doubts_html())

    def test_a_folder_without_results_is_refused(self):
        with self.assertRaisesRegex(RunError, "report.json' cannot be read"):
            Results(self.folder)
        self.write_report([])
        with self.assertRaisesRegex(RunError, "no transform.h5"):
            Results(self.folder)


if __name__ == "__main__":
    unittest.main()
