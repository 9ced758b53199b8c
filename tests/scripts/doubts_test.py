"""Every doubt of the program stands in the manual, and every one there is the program's; each has a test that hears it."""

import pathlib
import re
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
CODE = re.compile(r'"([a-z]+\.[a-z_]+)"')


def texts(*folders):
    return [path.read_text() for folder in folders for path in sorted((ROOT / folder).rglob("*"))
            if path.suffix in (".cpp", ".py") and path.name != "doubts_test.py"]


def codes():
    made = re.compile(r'(?:push_back\(\s*\{|Doubt\s*\{)\s*' + CODE.pattern)
    return {code for text in texts("registration", "apps") for code in made.findall(text)}


class Doubts(unittest.TestCase):
    def test_the_manual_lists_them(self):
        page = (ROOT / "docs" / "manual" / "doubts.md").read_text()
        listed = {code for row in re.findall(r"^\| (`.*?) \|", page, re.MULTILINE) for code in re.findall(r"`([a-z]+\.[a-z_]+)`", row)}
        self.assertGreater(len(listed), 30)
        self.assertEqual(listed, codes())

    def test_each_is_heard_in_a_test(self):
        heard = {code for text in texts("tests") for code in CODE.findall(text)}
        self.assertEqual(codes() - heard, set())


unittest.main()
