"""tissuewarp cohort: tables are refused with every problem that they have, runs are resumed and never done twice."""

import csv
import json
import os
import pathlib
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import unittest

import numpy

from phantom import PROGRAM, Phantom, run, save, MOVING_AFFINE

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROVENANCE = {"report.json", "report.html", "record.h5", "transform.h5"}  # with times of day and paths
# Debian's, which Snakemake runs with.
ENVIRONMENT = {"PATH": "/usr/bin:/bin:/usr/sbin:/sbin"}


def write_table(path, header, *rows):
    path.write_text("\n".join(",".join(row) for row in (header, *rows)) + "\n", encoding="utf-8")
    return path


def cohort(table, output, *more, timeout=110):
    return run("cohort", table, "--output", output, *more, timeout=timeout, **ENVIRONMENT)


class CohortTables(unittest.TestCase):
    HEADER = ["id", "moving", "labels", "fixed", "fixed_labels"]
    FILES = ["moving.nii.gz", "moving_labels.nii.gz", "fixed.nii.gz", "fixed_labels.nii.gz"]

    @classmethod
    def setUpClass(cls):
        cls.phantom = Phantom()
        cls.addClassCleanup(cls.phantom.temporary.cleanup)
        cls.folder, cls.output = cls.phantom.folder, cls.phantom.folder / "cohort"

    def table(self, *rows, header=()):
        return write_table(self.folder / "table.csv", [*self.HEADER, *header], *rows)

    def refused(self, table, *words, code=2, output=None):
        result = cohort(table, output or self.output, "--dry-run")
        self.assertEqual(result.returncode, code, result.stderr + result.stdout)
        for word in words:
            self.assertIn(word, result.stderr)
        self.assertNotIn("Traceback", result.stderr)
        self.assertFalse(self.output.exists())
        return result.stderr

    def accepted(self, table, *words):
        result = cohort(table, self.output, "--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)
        for word in words:
            self.assertIn(word, result.stdout)
        self.assertFalse(self.output.exists(), "a dry run wrote something")

    def test_all_problems_of_all_rows(self):
        table = self.table(["a", *self.FILES, "0", "brain"], ["a", *self.FILES, "3", "bran"],
                           ["../b", "none.nii.gz", *self.FILES[1:], "x", ""], header=["rounds", "tissue"])
        said = self.refused(table, "row 2, column 'rounds', '0': is out of range; give 1 to 1000",
                            "row 3, column 'id', 'a': is also that of row 2", "column 'tissue', 'bran'",
                            "row 4, column 'id', '../b'", "column 'moving', 'none.nii.gz': no such file",
                            "column 'rounds', 'x': is not a whole number", "6 problems")
        self.assertEqual(said.count("\n"), 7)

    def test_columns(self):
        self.refused(self.table(["a", *self.FILES, "1", "1"], header=["tisue", "output"]), "did you mean 'tissue'?",
                     "column 'output': is no column of a cohort")
        self.refused(write_table(self.folder / "t.csv", ["moving"], ["moving.nii.gz"]), "add a column 'id'")
        self.refused(self.table(["a", *self.FILES, "3", "4"], header=["rounds", "rounds"]), "stands there twice")
        self.refused(self.table(["a", *self.FILES, "surplus"]), "row 2: has 6 cells where the first line has 5")

    def test_tables_that_are_none(self):
        for content, code, word in ((b"", 2, "is empty"), (b"\0\1\2\xff", 2, "UTF-8"), (b"id\0,moving\n", 2, "zero bytes"),
                                    (b'id,moving\na,"open\n', 2, "quotes"), (b"id,moving\n", 2, "no rows")):
            (self.folder / "bad.csv").write_bytes(content)
            self.refused(self.folder / "bad.csv", word, code=code)
        self.refused(self.folder / "nowhere.csv", "cannot be read", code=3)

    def test_files(self):
        (self.folder / "text.nii.gz").write_text("no image")
        (self.folder / "short.nii").write_bytes(b"\x5c\x01\0\0" + bytes(100))
        (self.folder / "empty.ply").touch()
        table = self.table(["a", "text.nii.gz", *self.FILES[1:], ""], ["b", "short.nii", *self.FILES[1:], ""],
                           ["c", *self.FILES, "empty.ply"], header=["fixed_surface"])
        self.refused(table, "row 2, column 'moving', 'text.nii.gz': cannot be read", "row 3, column 'moving', 'short.nii'",
                     "row 4, column 'fixed-surface', 'empty.ply': is empty")

    def test_grids(self):
        save(numpy.ones((20, 20, 20), numpy.uint8), MOVING_AFFINE, self.folder / "other.nii.gz")
        other = ["moving.nii.gz", "other.nii.gz", *self.FILES[2:]]
        self.refused(self.table(["a", *other]), "column 'moving-labels', 'other.nii.gz': lies on another grid than "
                     "'moving.nii.gz' (20 x 20 x 20 and 48 x 48 x 48 voxels)")
        self.accepted(self.table(["a", "moving.nii.gz", "moving_labels.nii.gz", *self.FILES[2:], "true"],
                                 header=["resample_labels"]), "1 pairs, 0 done, 1 left")

    def test_rules_between_options_are_the_programs(self):
        self.refused(self.table(["a", *self.FILES, ""], ["b", *self.FILES, "moving_labels.nii.gz"], header=["moving_mask"]),
                     "row 3, column 'moving-mask': register says: --moving-mask", "add --match-image")

    def test_patients_that_rows_share_are_prepared_once(self):
        self.accepted(self.table(["a", *self.FILES], ["b", *self.FILES], ["c", *self.FILES[:2], self.FILES[2], ""]),
                      "3 pairs", "1 patients to prepare once")

    def test_bids(self):
        for subject in ("01", "02"):
            for session, files in (("pre", self.FILES[:2]), ("intra", self.FILES[2:])):
                folder = self.folder / "set" / f"sub-{subject}" / f"ses-{session}" / "anat"
                folder.mkdir(parents=True, exist_ok=True)
                for suffix, file in zip(("T1w", "dseg"), files):
                    shutil.copy(self.folder / file, folder / f"sub-{subject}_ses-{session}_{suffix}.nii.gz")
        cells = [f"bids:set:sub-*_ses-{session}_{suffix}" for session in ("pre", "intra") for suffix in ("T1w", "dseg")]
        self.accepted(self.table(["s*", *cells]), "2 pairs")
        self.refused(self.table(["a", "bids:set:ses-pre_T1w", *self.FILES[1:]]), "2 images have these entities")
        self.refused(self.table(["a", "bids:set:sub-03_T1w", *self.FILES[1:]]), "no image of the dataset")

    def test_ten_thousand_rows_in_a_minute_and_a_gigabyte(self):
        folder = self.folder / "many"
        folder.mkdir()
        rows = []
        for number in range(10_000):
            names = []
            for file in self.FILES:
                names.append(f"many/{number:05}_{file}")
                os.link(self.folder / file, self.folder / names[-1])
            rows.append([f"p{number:05}", *names, str(3 + number % 7)])
        table, start = self.table(*rows, header=["rounds"]), time.time()
        self.accepted(table, "10000 pairs, 0 done, 10000 left")
        self.assertLess(time.time() - start, 60)
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss, 1_000_000)  # kB


@unittest.skipUnless(shutil.which("snakemake", path=ENVIRONMENT["PATH"]), "no snakemake; run scripts/setup --cluster")
class CohortRuns(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-cohort-")
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = pathlib.Path(temporary.name)
        subprocess.run([sys.executable, ROOT / "scripts" / "random_cohort", cls.folder, "--patients", "2", "--times", "2",
                        "--size", "32", "--options", "edge_length=9,rounds=2,device=cpu"], check=True)
        cls.table, cls.output = cls.folder / "table.csv", cls.folder / "out"
        cls.first = cohort(cls.table, cls.output, "--jobs", "2")

    def again(self, *more, table=None, output=None):
        result = cohort(table or self.table, output or self.output, "--jobs", "2", *more)
        self.assertNotIn("Traceback", result.stderr)
        return result

    def moments(self):
        return {path.stem: path.stat().st_mtime_ns for path in (self.output / "done").iterdir()}

    def done_again(self, before):
        return sorted(name for name, moment in self.moments().items() if before.get(name) != moment)

    def test_everything_is_there(self):
        self.assertEqual(self.first.returncode, 0, self.first.stderr)
        self.assertIn("4 of 4 pairs done, 0 failed", self.first.stdout)
        self.assertEqual(len(list((self.output / "prepared").glob("*.tw"))), 2)
        with open(self.output / "cohort.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        self.assertEqual({row["state"] for row in rows}, {"done"})
        worst = [(int(row["doubts"]), float(row["worst_interval_95_mm"])) for row in rows]
        self.assertEqual(worst, sorted(worst, reverse=True), "doubts and the worst expected error come first")
        for row in rows:
            self.assertEqual(row["landmarks"], "60")
            self.assertLess(float(row["error_mean_mm"]), 4)
        page = (self.output / "cohort.html").read_text(encoding="utf-8")
        self.assertIn('href="pairs/p00001_t1/report.html"', page)
        self.assertEqual(page.count("data:image/png;base64,"), 4)
        self.assertNotIn("http", page)

    def test_the_bits_are_those_of_register(self):
        self.assertEqual(self.again().returncode, 0)  # whatever other tests did
        with open(self.table, encoding="utf-8") as file:
            row = next(csv.DictReader(file))
        name, short = row.pop("id"), {"labels": "moving-labels"}
        options = [f"--{short.get(key, key).replace('_', '-')}={self.folder / value if '.' in value else value}"
                   for key, value in row.items()]
        result = run("register", *options, "--output", self.folder / "alone")
        self.assertEqual(result.returncode, 0, result.stderr)
        compared = 0
        for path in (self.folder / "alone").iterdir():
            if path.name not in PROVENANCE:
                self.assertEqual(path.read_bytes(), (self.output / "pairs" / name / path.name).read_bytes(), path.name)
                compared += 1
        self.assertGreater(compared, 6)

    def test_nothing_is_done_twice_and_what_changed_is(self):
        before = self.moments()
        self.assertEqual(self.again().returncode, 0)
        self.assertEqual(self.done_again(before), [])
        image = self.folder / "p00001_t1.nii.gz"
        os.utime(image)
        self.assertEqual(self.again().returncode, 0)
        self.assertEqual(self.done_again(before), [], "the same bytes at another time are no other input")
        (self.output / "pairs" / "p00002_t1" / "warped.nii.gz").write_bytes(b"damaged")
        self.assertEqual(self.again().returncode, 0)
        self.assertEqual(self.done_again(before), ["p00002_t1"])
        before = self.moments()
        whole = image.read_bytes()
        image.write_bytes((self.folder / "p00001_t2.nii.gz").read_bytes())
        self.addCleanup(image.write_bytes, whole)
        other = self.folder / "other.csv"
        other.write_text(self.table.read_text().replace("p00002_t2.csv,9,2", "p00002_t2.csv,9,3"))
        self.assertEqual(self.again(table=other).returncode, 0)
        self.assertEqual(self.done_again(before), ["p00001_t1", "p00002_t2"])

    def test_interrupted_and_resumed(self):
        output = self.folder / "in {terrupted}: it's $HOME"
        child = subprocess.Popen([PROGRAM, "cohort", self.table, "--output", output, "--jobs", "1"], text=True,
                                 env={**os.environ, **ENVIRONMENT}, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        until = time.time() + 90
        while time.time() < until and not list((output / "done").glob("*.json")):
            time.sleep(0.05)
        child.send_signal(signal.SIGINT)
        said = child.communicate()[1]
        self.assertEqual(child.returncode, 130, said)
        self.assertIn("the same command goes on from there", said)
        done = {path.stem: path.stat().st_mtime_ns for path in (output / "done").iterdir()}
        self.assertIn(len(done), (1, 2, 3))
        result = self.again(output=output)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(len(list((output / "done").iterdir())), 4)
        for name, moment in done.items():
            self.assertEqual((output / "done" / f"{name}.json").stat().st_mtime_ns, moment, "done twice")

    def test_a_failure_is_listed_and_the_rest_goes_on(self):
        folder = self.folder / "corrupt"
        folder.mkdir()
        for path in self.folder.glob("p0000*"):
            shutil.copy(path, folder)
        table = folder / "table.csv"
        shutil.copy(self.table, table)
        image = folder / "p00001_t2.nii.gz"
        image.write_bytes(image.read_bytes()[:9000])
        result = self.again(table=table, output=folder / "out")
        self.assertEqual(result.returncode, 4, result.stderr)
        self.assertIn("3 of 4 pairs done, 1 failed", result.stdout)
        self.assertIn("p00001_t2 (row 3): tissuewarp update:", result.stderr)
        failure = json.loads((folder / "out" / "failed" / "p00001_t2.json").read_text())
        self.assertIn("p00001_t2.nii.gz", failure["why"])
        self.assertIn("cut short", (folder / "out" / "cohort.html").read_text())
        self.assertFalse((folder / "out" / "pairs" / "p00001_t2" / "report.json").exists())

    def test_loops_and_the_mean_of_linked_patients(self):
        header = ["id", "moving", "labels", "fixed", "fixed_labels", "true_labels", "from", "to", "edge_length", "rounds", "device"]
        files = {"A": "p00002", "B": "p00002_t1", "C": "p00002_t2"}
        rows = [[a + b, f"{files[a]}.nii.gz", f"{files[a]}_labels.nii.gz", f"{files[b]}.nii.gz", f"{files[b]}_labels.nii.gz",
                 f"{files[b]}_labels.nii.gz", a, b, "9", "2", "cpu"] for a, b in ("AB", "BC", "CA")]
        table, output = write_table(self.folder / "linked.csv", header, *rows), self.folder / "linked"
        self.assertIn("is no patient of the columns", self.again("--frame", "D", table=table, output=output).stderr)
        result = self.again("--frame", "A", table=table, output=output)
        self.assertEqual(result.returncode, 0, result.stderr)
        with open(output / "group" / "loops.csv", encoding="utf-8") as file:
            loop, = csv.DictReader(file)
        self.assertEqual(loop["loop"], "A → B → C → A")
        self.assertLess(float(loop["mean_mm"]), 3)
        self.assertIn("Mean of 3 patients in the frame of A", (output / "cohort.html").read_text(encoding="utf-8"))
        self.assertTrue((output / "group" / "mean_shape.nii.gz").exists())
        with open(output / "cohort.csv", encoding="utf-8") as file:
            self.assertGreater(min(float(row["true_dice"]) for row in csv.DictReader(file)), 0.9)

    def test_two_starts_in_one_folder(self):
        import fcntl
        with open(self.output / ".cohort" / "lock", "a") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            result = self.again()
        self.assertEqual(result.returncode, 1)
        self.assertIn("is being run already", result.stderr)


@unittest.skipUnless(shutil.which("snakemake", path=ENVIRONMENT["PATH"]), "no snakemake; run scripts/setup --cluster")
class CohortStudies(unittest.TestCase):
    def test_a_study_in_parts_is_the_study(self):
        with tempfile.TemporaryDirectory(prefix="tissuewarp-cohort-") as name:
            problems, more = "phantom:2001-2002", ["--evidence", "points"]
            script = [sys.executable, ROOT / "scripts" / "cluster_study", "coverage", problems, "--output", f"{name}/parts",
                      "--jobs", "2", "--program", PROGRAM, "--quiet", "--", *more]
            parts = subprocess.run(script, capture_output=True, text=True, env={**os.environ, **ENVIRONMENT})
            self.assertEqual(parts.returncode, 0, parts.stderr)
            whole = run("study", "coverage", "--problems", problems, *more, "--output", f"{name}/whole", "--quiet")
            self.assertEqual(parts.stdout.splitlines()[:2], whole.stdout.splitlines()[:2])
            self.assertTrue((pathlib.Path(name) / "parts" / "whole" / "coverage.svg").exists())


if __name__ == "__main__":
    unittest.main()
