"""Every command of the README and of the pages for users, as it stands there, on small files of the names that they use.

What is replaced is said here: registrations get a coarse mesh and two rounds, heads of scenes a cube, ultrasound an image that shows the same organ. Programs of the
repository are not run again; each is named with the test that runs it."""

import pathlib
import re
import shlex
import tempfile
import unittest

from pages_phantom import write_folder
from phantom import run

ROOT = pathlib.Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"

# Verbs that measure for minutes, whose tests run them with --quick, or that do not end. Here their options must exist.
MEASURING = {"serve": "serve_test.py", "bench": "bench_test.py", "study": "study_test.py", "calibrate": "dial_test.py",
             "cohort": "cohort_test.py"}
# Beginnings of commands that are not the program, and what runs them.
ELSEWHERE = {
    "git clone": "continuous integration",
    "cd ": "a shell",
    "export PATH": "a shell",
    "scripts/demo": "its registration stands on the page of the first hour, see test_the_demonstration",
    "scripts/test": ".ci/run",
    "apt install ./tissuewarp_": "scripts/test_package",
    "PYTHONPATH=build/release/python python3": "tests/python",
}
# Lines that hold an ellipsis are no commands; on these pages they are, and what runs them.
PATTERNS = {"docs/manual/slicer.md": "tests/slicer"}


def pages():
    return [ROOT / "README.md", *sorted(path for path in DOCS.rglob("*.md")
                                        if path.relative_to(DOCS).parts[0] not in ("lab", "decisions"))]


def commands(page):
    """Lines of the page's blocks of shell, those that go on joined."""
    text = page.read_text()
    blocks = re.findall(r"```sh\n(.*?)```", text, flags=re.DOTALL)
    blocks += re.findall(r"```\n(tissuewarp .*?)```", text, flags=re.DOTALL)
    lines = "\n".join(blocks).replace("\\\n", " ").splitlines()
    return [part.strip() for line in lines for part in line.split(" && ") if part.strip() and not part.startswith("#")]


def name_of(page):
    return str(page.relative_to(ROOT))


class Pages(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-pages-")
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        write_folder(cls.folder)
        result = run("register", "--moving", "preop.nii.gz", "--moving-labels", "preop_labels.nii.gz", "--fixed",
                     "intraop.nii.gz", "--fixed-labels", "intraop_labels.nii.gz", "--output", "out", *cls.quick([]),
                     folder=cls.folder)
        assert result.returncode == 0, result.stderr
        result = run("convert", "out/transform.h5", "ants_1Warp.nii.gz", folder=cls.folder)
        assert result.returncode == 0, result.stderr
        for words in (["--init", "cube"], ["cube.toml", "-o", "out/shift"]):
            result = run("simulate", *words, folder=cls.folder)
            assert result.returncode == 0, result.stderr
        cls.done = set()

    @staticmethod
    def quick(words):
        """What makes a registration quick, and no other."""
        more = ["--rounds", "2", "--device", "cpu"]
        chosen = {"--edge-length", "--moving-mesh", "--accuracy", "--time-budget"} & set(words)
        return more if chosen else ["--edge-length", "6", *more]

    def program(self, words):
        """Runs the program as the page says, or as this file says."""
        verb = words[0]
        if verb in MEASURING:
            return run(*words, "--help-all", folder=self.folder)
        if verb == "register":
            if "--moving-mesh" in words:
                self.mesh_of_gmsh(words[words.index("--moving-mesh") + 1])
            return run(*words, *self.quick(words), folder=self.folder)
        if verb == "compound":
            words = [word.replace("ultrasound.nii.gz", "compounded.nii.gz") for word in words]
        if verb in ("simulate", "explain"):
            words = [re.sub(r"^(brain-shift|liver|resection)", "cube", word) for word in words]
            if "--init" in words:
                (self.folder / "cube.toml").unlink(missing_ok=True)
        return run(*words, folder=self.folder)

    def mesh_of_gmsh(self, name):
        import meshio
        mesh = meshio.read(self.folder / "out" / "mesh.vtu")
        tetrahedra = mesh.cells_dict["tetra"]
        meshio.Mesh(mesh.points, [("tetra", tetrahedra)]).write(self.folder / name, file_format="gmsh22", binary=False)

    def check(self, line):
        if line in self.done:
            return
        self.done.add(line)
        words = shlex.split(line, comments=True)
        if not words or any(line.startswith(beginning) for beginning in ELSEWHERE):
            return
        self.assertEqual(words[0], "tissuewarp", "neither the program nor in ELSEWHERE")
        result = self.program(words[1:])
        self.assertEqual(result.returncode, 0, result.stderr + result.stdout)

    def run_pages(self, chosen):
        found = 0
        for page in pages():
            if not chosen(page):
                continue
            for line in commands(page):
                if "…" in line and name_of(page) in PATTERNS:
                    continue
                found += 1
                with self.subTest(page=name_of(page), command=line):
                    self.check(line)
        self.assertGreater(found, 3)

    def test_the_way_in(self):
        self.run_pages(lambda page: page.parent in (ROOT, DOCS))

    def test_recipes(self):
        self.run_pages(lambda page: page.parent.name == "recipes")

    def test_register(self):
        self.run_pages(lambda page: page.name.startswith("register"))

    def test_other_verbs(self):
        self.run_pages(lambda page: page.parent.name == "manual" and not page.name.startswith("register"))

    def test_the_demonstration(self):
        """What the first hour shows is what scripts/demo runs."""
        page = next(line for line in commands(DOCS / "first-hour.md") if line.startswith("tissuewarp register"))
        demo = (ROOT / "scripts" / "demo").read_text().replace("\\\n", " ").replace("$data", "data/brainshift")
        shown = set(zip(page.split()[2::2], page.split()[3::2]))
        started = re.search(r"tissuewarp register (.*)", demo)[1].split()
        self.assertEqual({pair for pair in shown if pair[0] != "--output"},
                         {pair for pair in zip(started[::2], started[1::2]) if pair[0] != "--output"})


if __name__ == "__main__":
    unittest.main()
