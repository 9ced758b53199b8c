"""The output folder: one run's files or another's, never a mixture, whenever and however a run is ended."""

import fcntl
import json
import os
import random
import resource
import signal
import subprocess
import time
import unittest

from phantom import PROGRAM, PhantomTest, run

IO = 3
INTERRUPTED = 130
QUICK = ["--edge-length", 8, "--rounds", 1, "--no-error-estimate", "--device", "cpu"]
DRILLS = int(os.environ.get("TISSUEWARP_DRILLS", "20"))
SIGNALS = [signal.SIGTERM, signal.SIGHUP, signal.SIGKILL]


def hidden(folder):
    return [name for name in os.listdir(folder) if name.startswith(".")] if folder.is_dir() else []


class OutputFolder(PhantomTest):
    def setUp(self):
        super().setUp()
        self.output = self.phantom.output

    def register(self, *more, **replaced):
        result = self.phantom.register(*QUICK, *more, **replaced)
        self.assertEqual(result.returncode, 0, result.stderr)
        return result

    def test_nothing_of_an_older_run_stays_beside_the_new_report(self):
        self.register()
        self.assertTrue((self.output / "warped.nii.gz").is_file())
        (self.output / "uncertainty.nii.gz").write_text("of an older run")
        (self.output / "warped_surface.ply").write_text("of an older run")
        (self.output / "notes.txt").write_text("of the user")
        self.register(moving=None)
        names = os.listdir(self.output)
        for name in ("warped.nii.gz", "uncertainty.nii.gz", "warped_surface.ply"):
            self.assertNotIn(name, names)
        self.assertIn("report.json", names)
        self.assertEqual((self.output / "notes.txt").read_text(), "of the user")
        self.assertEqual(hidden(self.output), [])

    def test_an_input_that_the_run_would_replace_is_refused(self):
        self.output.mkdir()
        labels = self.output / "warped_labels.nii.gz"
        labels.write_bytes(self.phantom.fixed_labels.read_bytes())
        result = self.phantom.register(*QUICK, fixed_labels=labels)
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("warped_labels.nii.gz' is a result in the output folder", result.stderr)
        self.assertEqual(os.listdir(self.output), ["warped_labels.nii.gz"])

    def test_a_folder_in_the_way_is_refused_before_anything_is_written(self):
        (self.output / "report.json").mkdir(parents=True)
        for more in ([], ["--dry-run"]):
            result = self.phantom.register(*more)
            self.assertEqual(result.returncode, IO, result.stderr)
            self.assertIn("report.json': it is a folder", result.stderr)
            self.assertEqual(os.listdir(self.output), ["report.json"])

    def test_an_output_folder_without_a_name_is_refused(self):
        result = run("register", "--moving-labels", self.phantom.moving_labels, "--fixed-labels", self.phantom.fixed_labels,
                     "--output", "")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("the output folder has no name; give one by --output", result.stderr)

    def test_a_folder_in_the_way_of_one_file_is_refused(self):
        folder = self.phantom.folder / "scores.json"
        folder.mkdir()
        result = run("evaluate", "--labels", self.phantom.fixed_labels, "--reference-labels",
                     self.phantom.fixed_labels, "--json", folder)
        self.assert_refused(result, IO, "scores.json': it is a folder")

    def test_what_killed_runs_left_is_swept_and_what_live_runs_write_is_not(self):
        self.output.mkdir()
        dead, alive = self.output / ".partial-999999", self.output / ".partial-999998"
        for folder in (dead, alive):
            folder.mkdir()
            (folder / "report.json").write_text("{}")
        lock = os.open(alive, os.O_RDONLY)
        self.addCleanup(os.close, lock)
        fcntl.flock(lock, fcntl.LOCK_EX)
        self.register()
        self.assertEqual(hidden(self.output), [alive.name])
        self.assertEqual(os.listdir(alive), ["report.json"])

    def test_a_commit_that_was_killed_is_completed_by_the_next_run_even_if_that_fails(self):
        for state, left in ((".complete-999999", ["report.json", "warped.nii.gz", "mesh.vtu"]),
                            (".ready-999999", ["mesh.vtu"])):
            with self.subTest(state):
                self.output.mkdir(exist_ok=True)
                for name in left:
                    (self.output / name).write_text("old")
                (self.output / state).mkdir()
                (self.output / state / "report.json").write_text("new")
                result = self.phantom.register("--edge-length", 8, fixed_labels=self.phantom.folder / "absent.nii.gz")
                self.assertEqual(result.returncode, IO, result.stderr)
                self.assertEqual((self.output / "report.json").read_text(), "new")
                self.assertEqual(hidden(self.output), [])
                self.assertFalse((self.output / "warped.nii.gz").exists())

    def test_frames_and_probes_of_an_older_simulation_go(self):
        scene = self.phantom.folder / "cube.toml"
        run("simulate", "--init", "cube", scene)
        self.output.mkdir()
        for name in ("frame_0999.vtu", "probes.csv", "mine.vtu"):
            (self.output / name).write_text("of before")
        result = run("simulate", scene, "--output", self.output)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertFalse((self.output / "frame_0999.vtu").exists())
        self.assertNotEqual((self.output / "probes.csv").read_text(), "of before")
        self.assertEqual((self.output / "mine.vtu").read_text(), "of before")

    def test_temporaries_of_one_file_are_swept(self):
        left = self.phantom.folder / ".scores.partial-999999.json"
        left.write_text("{")
        result = run("evaluate", "--labels", self.phantom.fixed_labels, "--reference-labels",
                     self.phantom.fixed_labels, "--json", self.phantom.folder / "scores.json")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertFalse(left.exists())


class Interruptions(PhantomTest):
    """Old results are whole, or new ones are, at whatever moment a signal comes. TISSUEWARP_DRILLS says how many."""

    def arguments(self, moving):
        files = {"moving-labels": self.phantom.moving_labels, "fixed-labels": self.phantom.fixed_labels,
                 "output": self.phantom.output}
        if moving:
            files["moving"] = self.phantom.moving
        return [PROGRAM, "register", *[str(part) for name, path in files.items() for part in ("--" + name, path)],
                *map(str, QUICK)]

    def start(self, moving):
        return subprocess.Popen(self.arguments(moving), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)

    def whole(self):
        """Which run's results the folder holds: that with a moving image, or that without."""
        report = json.loads((self.phantom.output / "report.json").read_text())
        moving = "moving" in report["inputs"]
        names = {name for name in os.listdir(self.phantom.output) if not name.startswith(".")}
        self.assertEqual("warped.nii.gz" in names, moving, names)
        self.assertLessEqual({"report.html", "record.h5", "mesh.vtu", "warped_labels.nii.gz"}, names)
        return moving

    def test_drill(self):
        before = time.monotonic()
        process = self.start(True)
        process.communicate()
        self.assertEqual(process.returncode, 0)
        span = time.monotonic() - before
        chance = random.Random(1)
        holds = True
        for drill in range(DRILLS):
            number = SIGNALS[drill % len(SIGNALS)]
            moment = chance.uniform(0, 1.05 * span)
            with self.subTest(drill=drill, signal=number, moment=moment):
                process = self.start(not holds)
                time.sleep(moment)
                process.send_signal(number)
                message = process.communicate()[1]
                if number == signal.SIGKILL and not (self.phantom.output / "report.json").exists():
                    self.phantom.register(*QUICK, fixed_labels="absent.nii.gz")  # completes the commit
                self.assertIn(process.returncode, (0, INTERRUPTED, -number), message)
                now = self.whole()
                self.assertIn(now, (holds, not holds))
                if process.returncode == 0:
                    self.assertEqual(now, not holds)
                if process.returncode == INTERRUPTED:
                    self.assertEqual(now, holds)
                    self.assertIn(b"nothing was written", message)
                    self.assertEqual([name for name in hidden(self.phantom.output) if str(process.pid) in name], [])
                holds = now
        self.phantom.register(*QUICK)
        self.assertEqual(hidden(self.phantom.output), [])

    def test_a_lost_connection_that_is_to_be_ignored_is_ignored(self):
        process = subprocess.Popen(self.arguments(True), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
                                   preexec_fn=lambda: signal.signal(signal.SIGHUP, signal.SIG_IGN))
        time.sleep(0.5)
        process.send_signal(signal.SIGHUP)
        self.assertEqual((process.communicate()[1], process.returncode), (b"", 0))


class Threads(PhantomTest):
    def arguments(self, *more):
        return ["evaluate", "--labels", self.phantom.fixed_labels, "--reference-labels", self.phantom.fixed_labels, *more]

    def test_no_more_threads_than_processors(self):
        result = run(*self.arguments("--threads", 1000))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertRegex(result.stderr, r"note: 1000 threads on \d+ processors; \d+ are used\n")

    def test_threads_that_cannot_be_made(self):
        def limit(processes):
            if os.getuid() == 0:
                os.setgid(65534)
                os.setuid(65534)
            resource.setrlimit(resource.RLIMIT_NPROC, (processes, processes))

        os.chmod(self.phantom.folder, 0o755)
        environment = {name: value for name, value in os.environ.items() if name != "OPENBLAS_NUM_THREADS"}
        for processes in (1, 2, 3):
            with self.subTest(processes=processes):
                result = subprocess.run([PROGRAM, *map(str, self.arguments())], capture_output=True, text=True,
                                        timeout=110, env=environment, preexec_fn=lambda: limit(processes))
                if result.returncode == 0:
                    self.skipTest("this machine does not limit threads")
                self.assertEqual(result.returncode, 1)
                self.assertRegex(result.stderr, r"^tissuewarp evaluate: \d+ threads are needed, \d+ can be made .*ulimit -u")



if __name__ == "__main__":
    unittest.main()
