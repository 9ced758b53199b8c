"""Every file that the repository holds: no merge was left half done, and every shell script can be read by its shell."""

import pathlib
import re
import subprocess
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
LEFT_OVER = re.compile(rb"^(<{7}|>{7}|\|{7})( |$)", re.MULTILINE)


def files():
    """Those that git tracks; of an archive without git all but what was built."""
    listed = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True)
    names = listed.stdout.decode().split("\0") if listed.returncode == 0 else [
        str(path.relative_to(ROOT)) for path in ROOT.rglob("*") if path.relative_to(ROOT).parts[0] not in ("build", "out")]
    return [ROOT / name for name in names if name and (ROOT / name).is_file()]


class Sources(unittest.TestCase):
    def test_a_left_over_is_seen(self):
        self.assertTrue(LEFT_OVER.search(b"a\n" + b"<" * 7 + b" HEAD\nb\n"))
        self.assertFalse(LEFT_OVER.search(b"a\n========\nb << 7\n"))

    def test_no_merge_is_left_half_done(self):
        self.assertGreater(len(files()), 1000)
        self.assertEqual([path for path in files() if LEFT_OVER.search(path.read_bytes())], [])

    def test_shells_read_their_scripts(self):
        scripts = [path for path in files() if re.match(rb"#!.*\b(ba)?sh\n", path.read_bytes()[:40])]
        self.assertGreater(len(scripts), 5)
        for script in scripts:
            read = subprocess.run(["bash", "-n", script], capture_output=True, text=True)
            self.assertEqual(read.returncode, 0, read.stderr)

    def test_scripts_say_how_they_are_used(self):
        for name in ("build", "demo", "docs", "setup", "test", "test_package"):
            script = ROOT / "scripts" / name
            told = subprocess.run([script, "--help"], capture_output=True, text=True, timeout=10, cwd="/")
            self.assertEqual(told.returncode, 0, name)
            self.assertIn(f"scripts/{name}", told.stdout)
            refused = subprocess.run([script, "--no-such-option"], capture_output=True, text=True, timeout=10, cwd="/")
            self.assertEqual(refused.returncode, 2, name)
            self.assertIn("--no-such-option", refused.stderr)


if __name__ == "__main__":
    unittest.main()
