"""One job: prepares a patient, or registers and scores a pair. Leaves a record when all is done, a failure with its
reason when not, and nothing when it is ended from outside.

    python3 -m tissuewarp_cohort.job OUTPUT pair|prepare NAME SESSION THREADS"""

import fcntl
import os
import resource
import signal
import subprocess
import sys
import time

from . import devices, thumbnail
from .check import OWN_FILES
from .digests import entry_of, read_json, write_json
from .layout import Layout
from .plan import TRUTH, is_done, request_of

LASTING = {2, 4, 5}  # exit codes of the program that another try does not change: options, numerics, no GPU
INTERRUPTED = 130


class Failed(Exception):
    def __init__(self, why, code=1):
        super().__init__(why)
        self.code = code


class Ended(Exception):
    """By a signal to this job: nothing is recorded."""


def run(command, log):
    """Runs the program, what it prints into the log; ends it when this job is ended."""
    log.write("$ " + " ".join(command) + "\n")
    log.flush()
    start = log.tell()
    child = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT)
    try:
        code = child.wait()
    except Ended:
        child.terminate()
        child.wait()
        raise
    if code == INTERRUPTED:
        raise Ended
    if code != 0:
        log.flush()
        raise Failed(reason(log.name, start, code), code)


def reason(path, start, code):
    with open(path, encoding="utf-8", errors="replace") as file:
        file.seek(start)
        lines = [line.strip() for line in file if line.strip()]
    if code < 0:
        return f"the program was killed by signal {-code} ({signal.Signals(-code).name})"
    return lines[-1] if lines else f"the program ended with {code} and said nothing"


def arguments(job, wanted):
    result = []
    for name in sorted(({*job["options"], *job["files"]} - OWN_FILES) & set(wanted)):
        values = job["files"].get(name) or job["options"].get(name)
        result += [f"--{name}={value}" for value in values] or [f"--{name}"]
    return result


def register_command(layout, job, threads, device):
    job = {**job, "options": {**job["options"], **({"device": [device]} if device else {})}}
    common = [f"--output={layout.pair(job['id'])}", f"--threads={threads}", "--quiet"]
    if not job["patient"]:
        return [job["program"]["path"], "register", *arguments(job, {*job["options"], *job["files"]}), *common]
    if read_json(layout.record("prepare", job["patient"])) is None:
        failure = read_json(layout.failure("prepare", job["patient"])) or {}
        raise Failed("its patient was not prepared: " + failure.get("why", "that job was ended before it was done"))
    return [job["program"]["path"], "update", layout.patient(job["patient"]),
            *arguments(job, job["update_options"]), *common]


def evaluate_command(layout, job, threads):
    """None where there is no truth."""
    files, folder = job["files"], layout.pair(job["id"])
    if not set(TRUTH) & set(files):
        return None
    field = os.path.join(folder, "displacement_moving_to_fixed.nii.gz")
    inverse = os.path.join(folder, "displacement_fixed_to_moving.nii.gz")
    command = [job["program"]["path"], "evaluate", f"--displacement={field}", f"--inverse={inverse}"]
    names = ["landmarks", "landmarks-moving", "landmarks-fixed", "held-out"]
    if set(names) & set(files):
        names.append("moving-labels")
    for name in names:
        command += [f"--{name}={path}" for path in files.get(name, [])]
    if "true-labels" in files:
        command += [f"--labels={os.path.join(folder, 'warped_labels.nii.gz')}",
                    f"--reference-labels={files['true-labels'][0]}"]
    return [*command, f"--json={os.path.join(folder, 'scores.json')}", f"--threads={threads}", "--quiet"]


def prepare_command(layout, job, threads):
    more = ["--for-labels"] if job["for_labels"] else []
    return [job["program"]["path"], "prepare", *arguments(job, {*job["options"], *job["files"]}), *more,
            f"--output={layout.patient(job['id'])}", f"--threads={threads}", "--quiet"]


def work(layout, job, threads, log):
    """Does the job. Returns the names of what it wrote, below the cohort's folder."""
    if job["kind"] == "prepare":
        run(prepare_command(layout, job, threads), log)
        return [os.path.relpath(layout.patient(job["id"]), layout.folder)]
    folder = layout.pair(job["id"])
    if "command" in job:
        return run_command(job, folder, threads)
    for name in ("scores.json", "thumbnail.png"):
        if os.path.exists(os.path.join(folder, name)):
            os.unlink(os.path.join(folder, name))
    with devices.taken(layout, job["options"].get("device", [""])[0]) as device:
        run(register_command(layout, job, threads, device), log)
    scoring = evaluate_command(layout, job, threads)
    if scoring:
        run(scoring, log)
    thumbnail.write(folder)
    return written(job, folder)


def written(job, folder):
    names = sorted(entry.name for entry in os.scandir(folder) if entry.is_file() and not entry.name.startswith("."))
    return [os.path.join("pairs", job["id"], name) for name in names]


def run_command(job, folder, threads):
    """A part of a study (studies.py): any command, what it prints as said.txt beside what it writes."""
    os.makedirs(folder, exist_ok=True)
    with open(os.path.join(folder, "said.txt"), "w", encoding="utf-8") as said:
        run([word.replace("{folder}", folder).replace("{threads}", str(threads)) for word in job["command"]], said)
    return written(job, folder)


def do(layout, job, session, threads):
    failure, record = (path(job["kind"], job["id"]) for path in (layout.failure, layout.record))
    inputs = {role: [entry_of(path) for path in paths] for role, paths in job["files"].items()}
    started = time.time()
    for path in (layout.log_of(job["kind"], job["id"]), record, layout.pair(job["id"])):
        os.makedirs(os.path.dirname(path), exist_ok=True)
    with open(layout.log_of(job["kind"], job["id"]), "a", encoding="utf-8") as log:
        names = work(layout, job, threads, log)
    outputs = {name: entry_of(os.path.join(layout.folder, name)) for name in names}
    memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000
    write_json(record, {"id": job["id"], "session": session, "request": request_of(job), "inputs": inputs,
                        "outputs": outputs, "foretold": job["foretold"], "finished": time.time(),
                        "took": {"seconds": time.time() - started, "memory_mb": memory, "threads": threads}})
    if os.path.exists(failure):
        os.unlink(failure)


def tried_in_vain(layout, job, session):
    failure = read_json(layout.failure(job["kind"], job["id"])) or {}
    return failure.get("session") == session and failure.get("lasting", False)


def is_lasting(job, why, code):
    """Whether another try would end alike: by the exit code, or since an input cannot be read."""
    return code in LASTING or any(path in why for paths in job["files"].values() for path in paths)


def attempt(layout, kind, name, session, threads):
    """0 done, 1 failed."""
    job = read_json(layout.job(kind, name))
    if job is None:
        print(f"no job '{name}' in '{layout.own}'; start tissuewarp cohort again", file=sys.stderr)
        return 1
    os.makedirs(os.path.dirname(layout.job_lock(kind, name)), exist_ok=True)
    with open(layout.job_lock(kind, name), "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if is_done(layout, job):
            return 0
        if tried_in_vain(layout, job, session):
            return 1
        if os.path.exists(layout.record(kind, name)):
            os.unlink(layout.record(kind, name))
        try:
            do(layout, job, session, threads)
            return 0
        except Failed as failed:
            why, code = str(failed), failed.code
        except OSError as failed:
            why, code = f"{failed.filename or ''}: {failed.strerror}", 3
        write_json(layout.failure(kind, name), {"id": name, "session": session, "code": code, "why": why,
                                                "lasting": is_lasting(job, why, code), "finished": time.time()})
        return 1


def end(_signal, _frame):
    raise Ended


def main():
    folder, kind, name, session, threads = sys.argv[1:6]
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, end)
    try:
        return attempt(Layout(folder), kind, name, session, int(threads))
    except Ended:
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
