"""One class of jobs as arrays of Slurm: submitted, waited for, and what was ended from outside submitted again with more
time and memory. Run by Snakemake.

    python3 -m tissuewarp_cohort.slurm_array OUTPUT pair|prepare CLASS SESSION"""

import math
import os
import re
import shlex
import signal
import subprocess
import sys
import time

from .digests import read_json, write_json
from .layout import Layout

TRIES = 3
MOST_TASKS = 1000  # of one array: Slurm's usual MaxArraySize is 1001
LONGEST_WAIT_S = 15
ENDED_WELL = {"COMPLETED"}


class SlurmRefused(Exception):
    """sbatch does not take the request."""


class Slurm:
    """Arrays that this process submitted and has not seen end."""

    def __init__(self):
        self.alive = []

    def submit(self, command, resources, tasks, limit, name, log):
        options = [f"--array=0-{tasks - 1}" + (f"%{limit}" if limit else ""), f"--job-name={name}", f"--output={log}",
                   "--open-mode=append", "--parsable", *resources]
        script = "#!/bin/bash\nexec " + command + " $SLURM_ARRAY_TASK_ID\n"
        done = subprocess.run(["sbatch", *options], input=script, capture_output=True, text=True)
        if done.returncode != 0:
            raise SlurmRefused(f"Slurm refused its array: {(done.stderr.strip() or 'it said nothing').splitlines()[-1]}")
        number = done.stdout.strip().split(";")[0]
        self.alive.append(number)
        return number

    def wait(self, numbers):
        """Until none of the arrays is queued or runs. A controller that does not answer is asked again."""
        pause = 1.0
        while numbers:
            time.sleep(pause)
            pause = min(LONGEST_WAIT_S, pause * 1.3)
            done = subprocess.run(["squeue", "--noheader", "--format=%i", "--jobs=" + ",".join(numbers)],
                                  capture_output=True, text=True)
            if done.returncode == 0 and not done.stdout.strip() or "Invalid job id" in done.stderr:
                self.alive = [number for number in self.alive if number not in numbers]
                return

    @staticmethod
    def states(number):
        """{task: state} as long as the controller remembers."""
        done = subprocess.run(["scontrol", "show", "job", "--oneliner", number], capture_output=True, text=True)
        return {int(found[1]): found[2]
                for found in re.finditer(r"ArrayTaskId=(\d+) .*?JobState=(\S+)", done.stdout)}

    def cancel(self):
        if self.alive:
            subprocess.run(["scancel", *self.alive])


class Array:
    def __init__(self, layout, kind, name, session):
        self.layout, self.kind, self.name, self.session = layout, kind, name, session
        plan = read_json(layout.plan)
        self.settings = plan["settings"]
        found = re.fullmatch(r"(\d+)MB-(\d+)min", name)
        self.memory_mb, self.minutes = int(found[1]), int(found[2])
        jobs = plan["left" if kind == "pair" else "patients_left"]
        self.jobs = [job for job, asked in jobs.items()
                     if (asked["memory_mb"], asked["minutes"]) == (self.memory_mb, self.minutes)]

    def open_jobs(self):
        """Those of which this start knows no lasting end."""
        def is_open(job):
            record = read_json(self.layout.record(self.kind, job))
            if record is not None:
                return False
            failure = read_json(self.layout.failure(self.kind, job)) or {}
            return failure.get("session") != self.session or not failure.get("lasting", False)
        return [job for job in self.jobs if is_open(job)]

    def resources(self, attempt, bundle):
        memory = min(self.settings["memory_mb"] or 1 << 40, int(self.memory_mb * 1.5 ** attempt))
        options = [f"--partition={self.settings['slurm']}", f"--cpus-per-task={self.settings['threads']}",
                   f"--mem={memory}M", f"--time={self.minutes * bundle * 2 ** attempt}"]
        return options + (["--gpus-per-task=1", "--ntasks=1"] if self.settings["gpus"] else [])

    def run_once(self, slurm, attempt, jobs):
        bundle = math.ceil(len(jobs) / MOST_TASKS)
        tasks = math.ceil(len(jobs) / bundle)
        listing = os.path.join(self.layout.own, "slurm", f"{self.kind}-{self.name}-{attempt}.json")
        write_json(listing, {"jobs": jobs, "bundle": bundle})
        command = " ".join(map(shlex.quote, [
            "env", f"PYTHONPATH={os.path.dirname(os.path.dirname(os.path.abspath(__file__)))}", "PYTHONDONTWRITEBYTECODE=1",
            sys.executable, "-m", "tissuewarp_cohort.slurm_task", self.layout.folder, self.kind, listing, self.session,
            str(self.settings["threads"])]))
        log = os.path.join(self.layout.folder, "logs", f"slurm-{self.kind}.txt")
        os.makedirs(os.path.dirname(log), exist_ok=True)
        number = slurm.submit(command, self.resources(attempt, bundle), tasks, self.settings["jobs"],
                              f"tissuewarp-{self.kind}", log)
        write_json(os.path.join(self.layout.own, "slurm", "arrays", number + ".json"), {"session": self.session})
        slurm.wait([number])
        self.explain(jobs, bundle, slurm.states(number))

    def explain(self, jobs, bundle, states):
        """Of jobs that left no word what Slurm says of their task."""
        for place, job in enumerate(jobs):
            failure = read_json(self.layout.failure(self.kind, job)) or {}
            state = states.get(place // bundle, "UNKNOWN")
            if (read_json(self.layout.record(self.kind, job)) is None and failure.get("session") != self.session
                    and state not in ENDED_WELL):
                self.fail(job, f"Slurm ended it: {state}; asked for were {self.memory_mb} MB and {self.minutes} minutes")

    def fail(self, job, why):
        write_json(self.layout.failure(self.kind, job), {"id": job, "session": self.session, "code": -1, "lasting": False,
                                                         "finished": time.time(), "why": why})

    def run(self, slurm):
        for attempt in range(TRIES):
            jobs = self.open_jobs()
            if not jobs:
                return
            self.run_once(slurm, attempt, jobs)


def main():
    folder, kind, name, session = sys.argv[1:5]
    slurm = Slurm()

    def end(_signal, _frame):
        slurm.cancel()
        sys.exit(130)

    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, end)
    array = Array(Layout(folder), kind, name, session)
    try:
        array.run(slurm)
    except SlurmRefused as refusal:
        for job in array.open_jobs():
            array.fail(job, f"{refusal} (asked for were {array.memory_mb} MB and {array.minutes} minutes)")
        print(refusal, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
