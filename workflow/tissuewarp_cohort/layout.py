"""Where things lie in the folder of a cohort."""

import os


class Layout:
    def __init__(self, folder):
        self.folder = os.path.abspath(folder)
        self.own = os.path.join(self.folder, ".cohort")
        self.plan = os.path.join(self.own, "plan.json")
        self.lock = os.path.join(self.own, "lock")
        self.log = os.path.join(self.own, "snakemake.log")
        self.page = os.path.join(self.folder, "cohort.html")
        self.table = os.path.join(self.folder, "cohort.csv")

    def job(self, kind, name):
        return os.path.join(self.own, "jobs", kind, name + ".json")

    def mark(self, kind, name):
        """Snakemake's own file for an ended job; of this start alone."""
        return os.path.join(self.own, "marks", kind, name)

    def job_lock(self, kind, name):
        return os.path.join(self.own, "locks", f"{kind}-{name}")

    def record(self, kind, name):
        """What a done job was: inputs, options, program, outputs."""
        return os.path.join(self.folder, "done" if kind == "pair" else "prepared", name + ".json")

    def failure(self, kind, name):
        return os.path.join(self.folder, "failed", name + ".json" if kind == "pair" else f"prepare-{name}.json")

    def log_of(self, kind, name):
        return os.path.join(self.folder, "logs", name + ".txt" if kind == "pair" else f"prepare-{name}.txt")

    def pair(self, name):
        return os.path.join(self.folder, "pairs", name)

    def patient(self, key):
        return os.path.join(self.folder, "prepared", key + ".tw")
