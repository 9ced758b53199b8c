"""The documents: links and anchors lead somewhere, pages stay short, figures have one source, and what pages say of options
is what the program says."""

import os
import pathlib
import re
import subprocess
import unicodedata
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
PROGRAM = os.environ["TISSUEWARP"]
# For developers, not for users: the theory.
LONG_PAGES = {"method.md"}
MOST_WORDS_OF_A_PAGE = 1500
MOST_WORDS = 30_000  # outside lab/ and decisions/


def tracked(*patterns):
    done = subprocess.run(["git", "-C", ROOT, "ls-files", "--cached", "--others", "--exclude-standard", *patterns],
                          capture_output=True, text=True, check=True)
    return [path for path in (ROOT / line for line in done.stdout.splitlines()) if path.is_file()]


def without_code(text):
    return re.sub(r"```.*?```|`[^`\n]*`", "", text, flags=re.DOTALL)


def anchors(page):
    """As GitHub and as mkdocs make them of headings; a link must be known to both."""
    kinds = [set(), set()]
    text = re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL)
    for heading in re.findall(r"^#{1,6} +(.*?)\s*$", text, flags=re.MULTILINE):
        heading = re.sub(r"\[([^\]]*)\]\([^)]*\)", r"\1", heading).replace("`", "").lower()
        kinds[0].add(re.sub(r"[^\w\- ]", "", heading).replace(" ", "-"))
        plain = unicodedata.normalize("NFKD", heading).encode("ascii", "ignore").decode()
        kinds[1].add(re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", plain).strip()))
    return kinds[0] & kinds[1]


def user_pages():
    return sorted(path for path in DOCS.rglob("*.md") if path.relative_to(DOCS).parts[0] not in ("lab", "decisions"))


def rows(page):
    return [line.strip() for line in page.read_text().splitlines() if line.startswith("|")]


def cells(row):
    return [cell.strip() for cell in re.split(r"(?<!\\)\|", row.strip().strip("|"))]


class Links(unittest.TestCase):
    def test_every_link_and_anchor(self):
        for page in tracked("*.md"):
            for target in re.findall(r"\]\(([^)\s]+)\)", without_code(page.read_text())):
                if re.match(r"[a-z]+:", target):
                    continue
                name, _, anchor = target.partition("#")
                found = (page.parent / name).resolve() if name else page
                with self.subTest(page=str(page.relative_to(ROOT)), link=target):
                    self.assertTrue(found.exists(), "leads nowhere")
                    if anchor and found.suffix == ".md":
                        self.assertIn(anchor, anchors(found))

    def test_pages_and_sections_that_sources_name(self):
        for path in tracked("*.hpp", "*.cpp", "*.glsl", "*.comp", "*.py", "*.txt", "*.cmake", "*.toml", "scripts/*"):
            try:
                text = re.sub(r"\n[ \t]*(///<|///|//!|//|#)?[ \t]*", " ", path.read_text())
            except UnicodeDecodeError:
                continue
            for name, section in re.findall(r"\b(docs/[\w/-]+\.md)(?:, (?:section )?\"([^\"]+)\")?", text):
                with self.subTest(file=str(path.relative_to(ROOT)), page=name):
                    self.assertTrue((ROOT / name).is_file(), "no such page")
                    if section:  # a heading, or the bold beginning of a paragraph
                        self.assertRegex((ROOT / name).read_text(), rf"(?m)^(#+ |(- )?\*\*){re.escape(section)}")

    def test_files_that_the_method_names(self):
        places = [ROOT, ROOT / "registration", ROOT / "tled"]
        for name in re.findall(r"`([\w/]+(?:\.[ch]pp|/))`", (DOCS / "method.md").read_text()):
            self.assertTrue(any((place / name).exists() for place in places), name)

    def test_tests_that_the_laboratory_names(self):
        sources = " ".join(path.read_text() for path in (ROOT / "tests").rglob("*_test.cpp"))
        sources += " ".join(path.read_text() for path in (ROOT / "tests" / "meshing").glob("test_*.cpp"))
        listed = [name for row in rows(DOCS / "lab" / "awkward-files.md")
                  for name in re.findall(r"`([^`]+)`", cells(row)[-1])]
        self.assertGreater(len(listed), 50)
        for name in listed:
            with self.subTest(test=name):
                script, _, test = name.rpartition(" ")
                if script:
                    kind, _, method = test.partition(".")
                    text = (ROOT / "tests" / "apps" / script).read_text()
                    body = re.search(rf"(?ms)^class {kind}\(.*?(?=^\S|\Z)", text)
                    self.assertTrue(body, "no such class")
                    self.assertIn(f"def {method or 'test_'}", body[0])
                else:
                    suite, _, case = name.partition(".")
                    self.assertRegex(sources, rf"TEST(_F|_P)?\({suite}, {case}\)")

    def test_every_page_is_in_the_index_or_the_menu(self):
        menu = (ROOT / "mkdocs.yml").read_text()
        for page in user_pages():
            self.assertIn(str(page.relative_to(DOCS)), menu)


class Length(unittest.TestCase):
    def test_pages(self):
        for page in user_pages():
            if page.name not in LONG_PAGES:
                self.assertLessEqual(len(page.read_text().split()), MOST_WORDS_OF_A_PAGE, page)

    def test_all(self):
        self.assertLess(sum(len(page.read_text().split()) for page in user_pages()), MOST_WORDS)

    def test_figures_have_captions(self):
        for page in user_pages():
            for caption in re.findall(r"!\[([^\]]*)\]\(", page.read_text()):
                self.assertGreater(len(caption), 3, page)


class Figures(unittest.TestCase):
    def test_readme_shows_rows_of_the_pages(self):
        """One source: docs/results.md and docs/performance.md."""
        readme = (ROOT / "README.md").read_text()
        part = readme[readme.index("## How good, how fast"):].split("\n## ")[0]
        shown = [line.strip() for line in part.splitlines() if line.startswith("|")]
        self.assertGreater(len(shown), 6)
        known = set(rows(DOCS / "results.md") + rows(DOCS / "performance.md"))
        for row in shown:
            self.assertIn(row, known)

    def test_errors_are_those_that_the_tests_hold(self):
        """mean / 95th of the phantoms' table are claims of tests/phantoms."""
        claims = " ".join(path.read_text() for path in (ROOT / "tests" / "phantoms").glob("*_test.cpp"))
        page = (DOCS / "results.md").read_text()
        table = page[page.index("## Phantoms"):page.index("## Random patients")]
        found = re.findall(r"^\|[^|]*\| *[\d.]+ *\| ([\d.]+) / ([\d.]+) \|", table, flags=re.MULTILINE)
        self.assertGreaterEqual(len(found), 8)
        for mean, percentile in found:
            self.assertIn(f"{mean}, {percentile}", claims)

    def test_every_row_says_whether_it_was_chosen_on(self):
        for line in rows(DOCS / "results.md"):
            last = cells(line)[-1]
            if last != "settings" and not set(last) <= set("-"):
                self.assertIn(last, ("chosen on it", "looked at", "never seen before"), line)

    def test_random_patients_are_those_of_the_laboratory(self):
        laboratory = (DOCS / "lab" / "accuracy-time.md").read_text()
        page = (DOCS / "results.md").read_text()
        table = page[page.index("## Random patients"):page.index("## Patients")]
        found = re.findall(r"^\|[^|]*\| ([\d.]+) \| ([\d.]+) \| (\*\*[\d.]+\*\*) \|", table, flags=re.MULTILINE)
        self.assertEqual(len(found), 9)
        for mean, percentile, within in found:
            self.assertRegex(laboratory, rf"\| {re.escape(mean)} \| {re.escape(percentile)} \|[^|]*\| {re.escape(within)}")


class NumbersOfTheCode(unittest.TestCase):
    """A number that a page states and the code holds: where it stands in the code, and the words around it on the page."""
    AVERAGES = ("tled/model.cpp", r"> (0\.\d+)\) return Element::AveragedPressureT4")
    NUMBERS = [
        ("registration/uncertainty/error_model.hpp", r"failed_mm = (\d+)",
         "what-the-numbers-mean.md", "may lie {} mm off or more"),
        ("registration/uncertainty.hpp", r"double failed_mm = (\d+)",
         "manual/register-outputs.md", "radius is more than {} mm"),
        (*AVERAGES, "manual/register-options.md", "above {} |"),
        (*AVERAGES, "manual/scene-file.md", "Poisson's ratio of {} |"),
        (*AVERAGES, "method.md", "Poisson's ratio is above {}"),
    ]

    def test_pages_say_what_the_code_holds(self):
        for source, pattern, page, words in self.NUMBERS:
            with self.subTest(source=source, page=page):
                found = re.search(pattern, (ROOT / source).read_text())
                self.assertTrue(found, "the code has no such number")
                self.assertIn(words.format(found[1]), (DOCS / page).read_text())

    def test_limits_in_words(self):
        """A quarter of the surface, twice what was to be expected."""
        surface = (ROOT / "registration" / "terms" / "surface.hpp").read_text()
        self.assertIn("least_coverage = 0.25;", surface, "pages say 'a quarter'")
        self.assertIn("most_z = 2;", (ROOT / "registration" / "uncertainty.hpp").read_text(), "pages say 'twice'")


class Options(unittest.TestCase):
    VERBS = {"register": ["register-options.md"], "mesh": ["mesh.md"], "warp": ["warp.md"], "convert": ["convert.md"], "compound": ["compound.md"],
             "evaluate": ["evaluate.md"], "info": ["info.md"], "simulate": ["simulate.md"],
             "explain": ["explain.md"], "calibrate": ["calibrate.md"], "study": ["study.md", "study-coverage.md"],
             "bench": ["bench.md"], "cohort": ["cohort.md"], "serve": ["serve.md"]}

    @staticmethod
    def of_program(verb):
        """{--option: default or ''} of --help-all."""
        text = subprocess.run([PROGRAM, verb, "--help-all"], capture_output=True, text=True, check=True).stdout
        found = re.findall(r"^  (?:-\w,)?(--[a-z-]+)(?: (?!LABEL)[A-Z/]+(?:=(\S+))?)?", text, flags=re.MULTILINE)
        return {name: default.strip("[]") for name, default in found}

    def test_pages_have_every_option_and_no_other(self):
        for verb, names in self.VERBS.items():
            known = self.of_program(verb)
            text = "\n".join((DOCS / "manual" / name).read_text() for name in names)
            listed = set()
            for line in text.splitlines():
                if line.startswith("| `-"):
                    listed |= set(re.findall(r"--[a-z-]+", cells(line)[0]))
            with self.subTest(verb=verb):
                self.assertEqual(set(known) - listed - {"--help", "--help-all"}, set(), "not on the page")
                self.assertEqual(listed - set(known) - {"--help-all"}, set(), "not in the program")

    def test_defaults_are_the_programs(self):
        for verb, names in self.VERBS.items():
            known = self.of_program(verb)
            for name in names:
                for line in rows(DOCS / "manual" / name):
                    entry = cells(line)
                    option = re.match(r"`(?:-\w, )?(--[a-z-]+)", entry[0])
                    if not option or len(entry) < 3 or not known.get(option[1]):
                        continue
                    stated = re.match(r"-?\w(?:[\w./-]|,(?=\w))*", entry[1].strip("`*"))
                    try:
                        same = stated is not None and float(stated[0]) == float(known[option[1]])
                    except ValueError:
                        same = stated is not None and stated[0] == known[option[1]]
                    in_words = entry[1].startswith(("what", "those", "as"))
                    with self.subTest(page=name, option=option[1]):
                        self.assertTrue(same or in_words, f"{known[option[1]]} in the program, {entry[1]} on the page")


if __name__ == "__main__":
    unittest.main()
