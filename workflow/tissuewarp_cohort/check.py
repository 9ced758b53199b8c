"""The whole table against options, files and grids, before anything runs."""

import concurrent.futures
import dataclasses
import os
import re
import subprocess
import tempfile

from . import bids, headers
from .problems import Problem, Refused
from .table import OWN, SEPARATOR, check_ids, read_table

MOST_COMBINATIONS = 24  # of options, each tried once by the program itself
SWITCHES = {"true": True, "1": True, "yes": True, "on": True, "false": False, "0": False, "no": False, "off": False}
OWN_FILES = {"true-labels", "held-out"}
GRIDS = (("moving", "moving-labels"), ("fixed", "fixed-labels"), ("fixed", "true-labels"), ("fixed-labels", "true-labels"))


@dataclasses.dataclass
class Pair:
    """A row as arguments: every value checked, every path absolute."""
    row: int
    id: str
    options: dict  # name: list of values; switches that are on have none
    files: dict  # name: list of paths; also those of OWN_FILES
    patients: tuple = ("", "")  # from, to
    voxels: tuple = (0, 0)  # of the moving and the fixed grid
    voxel_mm3: float = 1.0  # of the moving grid


class Files:
    """Grids of files, each looked at once."""

    def __init__(self):
        self.known = {}

    def grid(self, path):
        if path not in self.known:
            try:
                self.known[path] = headers.grid_of(path)
            except headers.Unusable as fault:
                self.known[path] = fault
            except OSError as failure:
                self.known[path] = headers.Unusable(f"cannot be read ({failure.strerror})", "ask for the right to read it")
        return self.known[path]


class Checker:
    def __init__(self, base, options):
        self.base, self.options = base, options
        self.files, self.datasets = Files(), bids.Datasets(base)
        self.problems = []

    def refuse(self, row, column, value, what, remedy):
        self.problems.append(Problem(row.number, column, value, what, remedy))

    def path_of(self, row, column, text):
        if text.startswith(bids.PREFIX):
            path, problem = bids.resolve(row, column, text, self.datasets)
            if problem:
                self.problems.append(problem)
                return None
        else:
            path = os.path.join(self.base, os.path.expanduser(text))
        path = os.path.abspath(path)
        if not os.path.exists(path):
            self.refuse(row, column, text, "no such file", f"paths are relative to '{self.base}', the table's folder")
            return None
        found = self.files.grid(path)
        if isinstance(found, headers.Unusable):
            self.refuse(row, column, text, found.what, found.remedy)
            return None
        return path

    def number(self, row, option, text):
        try:
            value = int(text) if option.kind == "integer" else float(text)
        except ValueError:
            kind = "a whole number" if option.kind == "integer" else "a number"
            return self.refuse(row, option.name, text, "is not " + kind, "write one, with a point and without its unit")
        if not option.least <= value <= option.most:
            self.refuse(row, option.name, text, "is out of range", f"give {option.least:g} to {option.most:g}")
        return [text]

    def value(self, row, option, text):
        """Values of the option, None where it is off or wrong."""
        if option.kind == "switch":
            if text.lower() not in SWITCHES:
                return self.refuse(row, option.name, text, "is neither true nor false", "write true, false or nothing")
            return [] if SWITCHES[text.lower()] else None
        if option.kind in ("number", "integer"):
            return self.number(row, option, text)
        if option.kind == "choice" and text not in option.choices:
            return self.refuse(row, option.name, text, "is none of its values", "give " + ", ".join(option.choices))
        if option.name == "device" and not re.fullmatch(r"auto|cpu|gpu(:\d+)?", text):
            return self.refuse(row, option.name, text, "is no device", "give auto, cpu, gpu or gpu:<index>")
        return [part.strip() for part in text.split(SEPARATOR)] if option.repeatable else [text]

    def pair(self, row):
        result = Pair(row.number, row.id, {}, {}, (row.cells.get("from", ""), row.cells.get("to", "")))
        for column, text in row.cells.items():
            option = self.options.get(column)
            if column in OWN_FILES or (option and option.kind == "file"):
                parts = text.split(SEPARATOR) if option and option.repeatable else [text]
                paths = [self.path_of(row, column, part.strip()) for part in parts]
                if None not in paths:
                    result.files[column] = paths
            elif column not in OWN and option:
                values = self.value(row, option, text)
                if values is not None:
                    result.options[column] = values
        self.check_grids(row, result)
        if "held-out" in result.files and "moving-labels" not in result.files:
            self.refuse(row, "held-out", row.cells["held-out"], "is scored against the surface of labels",
                        "give the column 'labels' too, or leave it out")
        return result

    def check_grids(self, row, pair):
        grids = {name: self.files.grid(paths[0]) for name, paths in pair.files.items()}
        for image, labels in GRIDS:
            a, b = grids.get(image), grids.get(labels)
            if a and b and not headers.same_grid(a, b) and "resample-labels" not in pair.options:
                self.refuse(row, labels, os.path.basename(pair.files[labels][0]),
                            f"lies on another grid than '{os.path.basename(pair.files[image][0])}' "
                            f"({' x '.join(map(str, b.size))} and {' x '.join(map(str, a.size))} voxels)",
                            "give labels drawn on that image" if labels == "true-labels"
                            else "give labels drawn on that image, or add a column 'resample_labels' with true")
        moving = grids.get("moving-labels") or grids.get("moving")
        fixed = grids.get("fixed") or grids.get("fixed-labels")
        pair.voxels = (moving.voxels() if moving else 0, fixed.voxels() if fixed else 0)
        if moving:
            x, y, z = moving.spacing()
            pair.voxel_mm3 = x * y * z


def arguments_of(pair, wanted=lambda name: True):
    """--name=value …, as the program reads them."""
    result = []
    for name in sorted({*pair.options, *pair.files} - OWN_FILES):
        if wanted(name):
            values = pair.files.get(name) or pair.options[name]
            result += [f"--{name}={value}" for value in values] or [f"--{name}"]
    return result


def combination(pair, options):
    """What the rules between options can depend on: which are given, and values that are no numbers."""
    words = tuple(sorted((name, *values) for name, values in pair.options.items()
                         if options[name].kind not in ("number", "integer")))
    counts = tuple(sorted((name, len(paths)) for name, paths in pair.files.items()))
    return words, counts, tuple(sorted(pair.options))


def complaint_of(program, pair, scratch):
    """What the program says against the pair's options, without running it; empty if nothing."""
    device = [] if "device" in pair.options else ["--device=cpu"]
    command = [program.path, "register", *arguments_of(pair), *device, "--dry-run"]
    done = subprocess.run([*command, f"--output={os.path.join(scratch, pair.id)}"], capture_output=True, text=True)
    lines = [line for line in done.stderr.splitlines() if not line.startswith("note")]
    return (lines or [f"ended with {done.returncode}"])[-1].removeprefix("tissuewarp register: ") if done.returncode else ""


def column_of(complaint, pair):
    named = [name for name in re.findall(r"--([a-z-]+)", complaint) if name in pair.options or name in pair.files]
    return named[0] if named else ""


def try_combinations(program, pairs, jobs):
    """(problems, notes): one pair of each combination of options is checked by the program's own --dry-run."""
    first = {}
    for pair in pairs:
        first.setdefault(combination(pair, program.options), pair)
    tried = list(first.values())[:MOST_COMBINATIONS]
    with tempfile.TemporaryDirectory() as scratch, concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        complaints = list(pool.map(lambda pair: complaint_of(program, pair, scratch), tried))
    problems = []
    for pair, complaint in zip(tried, complaints):
        if complaint:
            what, _, remedy = complaint.partition("; ")
            problems.append(Problem(pair.row, column_of(complaint, pair), "", f"register says: {what}",
                                    remedy or "correct the row, and those with the same options"))
    notes = []
    if len(first) > len(tried):
        notes.append(f"{len(first)} combinations of options; the rules between options were tried on {len(tried)} "
                     "of them and are checked on the others as they run")
    return problems, notes


def checked_pairs(table, program, jobs=2):
    """(pairs, notes) of the table. Throws Refused with every problem that it has."""
    base = os.path.dirname(os.path.abspath(table))
    checker = Checker(base, program.options)
    rows, problems = read_table(table, program.options)
    if any(problem.row == 1 for problem in problems):
        raise Refused(problems)
    rows, more = bids.expand(rows, checker.datasets)
    problems += more + check_ids(rows)
    pairs = [checker.pair(row) for row in rows]
    problems += checker.problems
    if problems:
        raise Refused(problems)
    problems, notes = try_combinations(program, pairs, jobs)
    if problems:
        raise Refused(problems)
    return pairs, notes
