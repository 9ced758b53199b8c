"""From checked pairs to jobs: patients that several rows share are prepared once, and what is done stays done."""

import collections
import os
import shutil

from . import foretell
from .check import OWN_FILES
from .digests import digest_of_json, is_as_recorded, read_json, write_json

SCHEMA = 1
ALONE = {"accuracy", "time-budget", "config"}  # options of register alone: such a pair is not cut in two
TRUTH = ("landmarks", "landmarks-moving", "true-labels", "held-out")
REGISTERED_LABELS = "fixed-labels"


def preoperative(pair, options):
    """What prepare would be asked for, or None where the pair is for register alone."""
    if ALONE & {*pair.options, *pair.files}:
        return None
    def makes(name):
        return name in options and options[name].prepares

    return {"options": {name: values for name, values in pair.options.items() if makes(name)},
            "files": {name: paths for name, paths in pair.files.items() if makes(name)},
            "for_labels": REGISTERED_LABELS in pair.files and "edge-length" not in pair.options
            and "moving-mesh" not in pair.files}


def patients_of(pairs, options):
    """{id of the pair: key of its patient}, for patients that two or more pairs share; and {key: request}."""
    requests, users = {}, collections.defaultdict(list)
    for pair in pairs:
        request = preoperative(pair, options)
        if request is not None:
            key = digest_of_json(request)[:16]
            requests[key] = request
            users[key].append(pair.id)
    shared = {key for key, names in users.items() if len(names) > 1}
    return {name: key for key in shared for name in users[key]}, {key: requests[key] for key in shared}


def update_options(names, options):
    """Of the names of a pair's options those that update takes."""
    return [name for name in names if name not in OWN_FILES and options[name].updates]


def job_of_pair(pair, key, program, settings, scale):
    options = dict(pair.options)
    if settings["devices"] and "device" not in options:
        options["device"] = ["gpu"]
    seconds, memory, disk = foretell.of_pair(pair)
    return {"schema": SCHEMA, "kind": "pair", "id": pair.id, "row": pair.row, "patient": key,
            "program": program_of(program), "options": options, "files": pair.files, "patients": list(pair.patients),
            "update_options": update_options({*options, *pair.files}, program.options) if key else [],
            "foretold": {"seconds": seconds, "memory_mb": memory, "bytes": disk},
            "asked": asked(foretell.wall_seconds(seconds * scale.seconds, settings["threads"]), memory * scale.memory)}


def job_of_patient(key, request, first, program, settings, scale):
    seconds, memory, disk = foretell.of_pair(first)
    return {"schema": SCHEMA, "kind": "prepare", "id": key, "program": program_of(program), **request,
            "foretold": {"seconds": seconds, "memory_mb": memory, "bytes": disk},
            "asked": asked(foretell.wall_seconds(seconds * scale.seconds, settings["threads"]), memory * scale.memory)}


def program_of(program):
    return {"path": program.path, "version": program.version, "sha256": program.sha256}


def asked(seconds, memory):
    """Memory and time to ask for: powers of two, so that jobs fall into few classes."""
    return {"memory_mb": power_of_two(memory * foretell.HEADROOM, 512),
            "minutes": power_of_two(seconds * foretell.HEADROOM / 60, 2)}


def power_of_two(value, least):
    while least < value:
        least *= 2
    return least


def request_of(job):
    """All that the bits of a job depend on, but for what its files hold."""
    program = {name: job["program"][name] for name in ("version", "sha256")}
    return {"schema": SCHEMA, "program": program, "options": job["options"], "for_labels": job.get("for_labels", False)}


def is_done(layout, job):
    """Whether its outputs are those of its inputs, its options and this program."""
    record = read_json(layout.record(job["kind"], job["id"]))
    if not record or record.get("request") != request_of(job):
        return False
    inputs, outputs = record.get("inputs", {}), record.get("outputs", {})
    if not outputs or {role: len(paths) for role, paths in job["files"].items()} != {
            role: len(entries) for role, entries in inputs.items()}:
        return False
    same_inputs = all(is_as_recorded(path, entry) for role, paths in job["files"].items()
                      for path, entry in zip(paths, inputs[role]))
    return same_inputs and all(is_as_recorded(os.path.join(layout.folder, name), entry)
                               for name, entry in outputs.items())


class Plan:
    """All jobs, and those that are left to do."""

    def __init__(self, layout, pairs, program, settings):
        self.layout, self.settings = layout, settings
        self.scale = foretell.Scale(layout.folder)
        keys, requests = patients_of(pairs, program.options)
        first = {}
        for pair in pairs:
            first.setdefault(keys.get(pair.id), pair)
        self.pairs = [job_of_pair(pair, keys.get(pair.id), program, settings, self.scale) for pair in pairs]
        self.left = [job for job in self.pairs if not is_done(layout, job)]
        needed = {job["patient"] for job in self.left} - {None}
        patients = [job_of_patient(key, requests[key], first[key], program, settings, self.scale) for key in sorted(needed)]
        self.patients_left = [job for job in patients if not is_done(layout, job)]

    def foretold(self):
        """Totals of what is left: seconds of work, MB of the largest job, bytes."""
        jobs = self.left + self.patients_left
        return {"seconds": self.scale.seconds * sum(job["foretold"]["seconds"] for job in jobs),
                "memory_mb": max((job["asked"]["memory_mb"] for job in jobs), default=0),
                "bytes": sum(job["foretold"]["bytes"] for job in jobs)}

    def write(self):
        write_plan(self)


def write_plan(plan):
    """What Snakemake and the jobs read; records of what is left to do, which are of other inputs or options, go."""
    shutil.rmtree(os.path.join(plan.layout.own, "marks"), ignore_errors=True)
    for job in plan.left + plan.patients_left:
        for stale in (plan.layout.record(job["kind"], job["id"]), plan.layout.failure(job["kind"], job["id"])):
            if os.path.exists(stale):
                os.unlink(stale)
        write_json(plan.layout.job(job["kind"], job["id"]), job)
    remaining = {job["id"] for job in plan.patients_left}
    write_json(plan.layout.plan, {
        "schema": SCHEMA, "settings": plan.settings,
        "left": {job["id"]: {"patient": job["patient"] if job["patient"] in remaining else None, **job["asked"]}
                 for job in plan.left},
        "patients_left": {job["id"]: job["asked"] for job in plan.patients_left}})
