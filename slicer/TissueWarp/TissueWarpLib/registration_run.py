"""What the module does apart from 3D Slicer: the command line, the running program, its progress and its results.

Plain Python: it imports neither slicer nor Qt, and is tested without them.
"""

import html
import json
import os
import pathlib
import re
import shlex
import shutil
import subprocess

# Inputs by the option that takes them, and how their files end.
FILE_ENDINGS = {
    "moving": ".nrrd",
    "fixed": ".nrrd",
    "moving-labels": ".nrrd",
    "fixed-labels": ".nrrd",
    "fixed-surface": ".vtp",
    "moving-points": ".mrk.json",
    "fixed-points": ".mrk.json",
    "landmarks-moving": ".mrk.json",
    "landmarks-fixed": ".mrk.json",
}
PAIRS = [("moving-points", "fixed-points"), ("landmarks-moving", "landmarks-fixed")]

# What is loaded when a run has ended.
RESULT_FILES = {
    "transform": "transform.h5",
    "warped": "warped.nii.gz",
    "organ": "organ.vtp",
    "error": "uncertainty.nii.gz",
    "landmarks": "warped_landmarks.mrk.json",
}


class RunError(Exception):
    """A text for the user: what is wrong, and what to do about it."""


def find_program(named="", beside=None):
    """The program that the user named, else that of the installation around the folder `beside`, else that of PATH."""
    if named:
        if os.access(named, os.X_OK) and os.path.isfile(named):
            return str(named)
        raise RunError(f"'{named}' is no program; choose the file tissuewarp")
    installed = pathlib.Path(beside).resolve().parents[3] / "bin" / "tissuewarp" if beside else None
    if installed and installed.is_file():
        return str(installed)
    found = shutil.which("tissuewarp")
    if not found:
        raise RunError("the program tissuewarp was not found; install its package, or choose the file under Program")
    return found


def segment_order(moving, fixed):
    """Names of segments to write, so that a name has the same label in both maps: those of both images first.

    Segments of the fixed image alone are left out: nothing of the moving one belongs there.
    """
    for which, names in (("moving", moving), ("fixed", fixed)):
        twice = sorted({name for name in names or [] if names.count(name) > 1})
        if twice:
            raise RunError(f"two segments of the {which} image are called '{twice[0]}'; rename one of them")
    if fixed is None:
        return list(moving), []
    both = [name for name in moving if name in fixed]
    if not both:
        raise RunError(f"no segment has one name in both images (moving: {', '.join(moving)}; fixed: {', '.join(fixed)}); "
                       "name the same tissue alike")
    return both + [name for name in moving if name not in fixed], both


def require_complete(inputs):
    """Throws RunError for choices that cannot be run: before anything is written."""
    for first, second in PAIRS:
        if (first in inputs) != (second in inputs):
            given, lacking = (first, second) if first in inputs else (second, first)
            raise RunError(f"'{given}' is chosen and '{lacking}' is not; choose both or none")
    if "moving" not in inputs and "moving-labels" not in inputs:
        raise RunError("nothing says where the organ is; choose the moving volume, its segmentation, or both")
    if not {"fixed", "fixed-labels", "fixed-surface", "fixed-points"} & inputs.keys():
        raise RunError("nothing to register to; choose the fixed volume, segmentation, surface or points")


def command_line(program, files, folder, more=""):
    """Arguments of a run: `files` by option, results into folder/out, `more` as the user typed it."""
    require_complete(files)
    folder = pathlib.Path(folder)
    command = [str(program), "register"]
    for option in FILE_ENDINGS:
        if option in files:
            command += ["--" + option, str(files[option])]
    written = "organ,markups" if "landmarks-moving" in files else "organ"
    command += ["--output", str(folder / "out"), "--write", written,
                "--returnparameterfile", str(folder / "returned.params")]
    try:
        return command + shlex.split(more)
    except ValueError as error:
        raise RunError(f"more options '{more}': {error}; close the quotes") from error


def parse_progress(text):
    """(fraction, stage) that the program told last; a stage of None where none is known yet."""
    fractions = re.findall(r"<filter-progress>([0-9.]+)</filter-progress>", text)
    stages = re.findall(r"<filter-name>([^<]*)</filter-name>", text)
    return (float(fractions[-1]) if fractions else 0.0), (stages[-1] if stages else None)


class RegistrationRun:
    """The program as a process. `poll` is called by a timer; nothing blocks but `wait`."""

    def __init__(self, command, folder, environment=None):
        self.folder = pathlib.Path(folder)
        self.folder.mkdir(parents=True, exist_ok=True)
        self.cancelled = False
        with open(self.folder / "stdout.txt", "wb") as out, open(self.folder / "stderr.txt", "wb") as err:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=err, env=environment)

    def poll(self):
        """(fraction, stage, whether it still runs)"""
        running = self.process.poll() is None
        return (*parse_progress((self.folder / "stdout.txt").read_text(errors="replace")), running)

    def cancel(self):
        """Asks the program to stop, which leaves older results whole; a second time it is ended at once."""
        if self.cancelled:
            self.process.kill()
        else:
            self.process.terminate()
        self.cancelled = True

    def wait(self, seconds=None):
        self.process.wait(seconds)

    def results(self):
        """Throws RunError where the run did not succeed."""
        code = self.process.returncode
        if code == 0:
            return Results(self.folder / "out")
        if self.cancelled:
            raise RunError("cancelled; nothing was written")
        said = (self.folder / "stderr.txt").read_text(errors="replace").strip().splitlines()
        raise RunError(said[-1] if said else f"tissuewarp ended with code {code} and said nothing; see {self.folder}")


class Results:
    """The folder of results: which files there are to load, and what report.json says of them."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        path = self.folder / "report.json"
        try:
            self.report = json.loads(path.read_text())
        except (OSError, ValueError) as error:
            raise RunError(f"'{path}' cannot be read ({error}); run the registration again") from error
        self.files = {role: self.folder / name for role, name in RESULT_FILES.items() if (self.folder / name).is_file()}
        if "transform" not in self.files:
            raise RunError(f"there is no transform.h5 in '{self.folder}'; run the registration again")

    def doubts(self):
        """[(code, text with remedy, whether it is a notice only)]"""
        result = []
        for doubt in self.report.get("doubts", []):
            text = "; ".join(part for part in (doubt["text"], doubt.get("remedy", "")) if part)
            result.append((doubt["code"], text, doubt.get("severity") == "notice"))
        return result

    def doubts_html(self):
        """Doubts in red, notices in black, or a sentence that there are none."""
        rows = [f'<p style="color:{"black" if notice else "#c00000"}">{"" if notice else "<b>Doubt:</b> "}'
                f"{html.escape(text)} <i>({html.escape(code)})</i></p>" for code, text, notice in self.doubts()]
        return "".join(rows) or "<p>No doubts were found. Look at the pictures all the same.</p>"
