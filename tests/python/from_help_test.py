"""Man pages and completion hold what --help-all says, and are read by man and bash."""

import gzip
import os
import pathlib
import re
import shutil
import subprocess
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ["TISSUEWARP"]


def help_of(verb=None, option="--help"):
    return subprocess.run([PROGRAM, *([verb] if verb else []), option], check=True, capture_output=True, text=True).stdout


class FromHelp(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = tempfile.TemporaryDirectory()
        cls.addClassCleanup(folder.cleanup)
        cls.share = pathlib.Path(folder.name)
        subprocess.run([ROOT / "packaging/from_help.py", PROGRAM, cls.share], check=True)
        cls.completion = cls.share / "bash-completion/completions/tissuewarp"

    def page(self, name):
        return gzip.decompress((self.share / f"man/man1/{name}.1.gz").read_bytes()).decode()

    def test_a_page_for_each_verb_with_every_option(self):
        verbs = {path.name.removesuffix(".1.gz") for path in (self.share / "man/man1").iterdir()}
        self.assertIn("tissuewarp-simulate", verbs)
        listed = re.findall(r"^  (\w+)  +\S", help_of().split("Subcommands:")[1], flags=re.MULTILINE)
        self.assertEqual(verbs, {"tissuewarp", *(f"tissuewarp-{verb}" for verb in listed)})
        for name in verbs - {"tissuewarp"}:
            text = self.page(name).replace(r"\-", "-")
            for option in re.findall(r"^ +(--[a-z-]+)", help_of(name.split("-", 1)[1], "--help-all"), flags=re.MULTILINE):
                self.assertIn(option, text, name)
            self.assertIn(".SH SYNOPSIS", text)

    def test_man_reads_them(self):
        if not shutil.which("groff"):
            self.skipTest("no groff")
        done = subprocess.run(["groff", "-man", "-ww", "-Tascii"], input=self.page("tissuewarp-register"), text=True,
                              capture_output=True, check=True)
        self.assertEqual(done.stderr, "")
        self.assertIn("Young's modulus", done.stdout)

    def complete(self, *words):
        script = f"source {self.completion}; COMP_WORDS=({' '.join(words)}); COMP_CWORD={len(words) - 1}; " \
                 "compopt() { :; }; _tissuewarp; echo \"${COMPREPLY[@]}\""
        done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
        return done.stdout.split()

    def test_bash_completes(self):
        self.assertEqual(self.complete("tissuewarp", "sim"), ["simulate"])
        self.assertEqual(self.complete("tissuewarp", "register", "--moving-l"), ["--moving-labels"])
        self.assertEqual(self.complete("tissuewarp", "register", "--output", "''"), [])


if __name__ == "__main__":
    unittest.main()
