"""Studies in parts: each seed or problem is a job of the workflow, done, resumed and retried as pairs are."""

import os

from . import plan


class StudyPlan:
    """As plan.Plan, of commands. `parts`: {name: words}, in which {folder} and {threads} stand for those of the job."""
    patients_left = []

    def __init__(self, layout, parts, program, settings, seconds, memory_mb):
        self.layout, self.settings = layout, settings
        self.pairs = [self.job(name, words, program, seconds, memory_mb) for name, words in parts.items()]
        self.left = [job for job in self.pairs if not plan.is_done(layout, job)]

    @staticmethod
    def job(name, words, program, seconds, memory_mb):
        return {"schema": plan.SCHEMA, "kind": "pair", "id": name, "row": 0, "patient": None, "command": words,
                "program": plan.program_of(program), "options": {"command": words[1:]}, "files": {}, "patients": ["", ""],
                "foretold": {"seconds": seconds, "memory_mb": memory_mb, "bytes": 0}, "asked": plan.asked(seconds, memory_mb)}

    def write(self):
        plan.write_plan(self)


def gather(layout, jobs, ends, target):
    """Links the parts' files with one of these ends into one folder; names are the studies' own, by seed."""
    os.makedirs(target, exist_ok=True)
    for folder in (layout.pair(job["id"]) for job in jobs):
        for name in sorted(os.listdir(folder)):
            if name.endswith(ends):
                place = os.path.join(target, name)
                if os.path.lexists(place):
                    os.unlink(place)
                os.link(os.path.join(folder, name), place)
