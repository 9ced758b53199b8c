"""How far the jobs are, from the records that they leave, and how long it will take."""

import os
import sys
import time


def text_of(seconds):
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


class Progress:
    """Weighs jobs by what was foretold of them. Prints one line that it rewrites, or a new one each tenth."""

    def __init__(self, plan, quiet):
        self.layout, self.quiet = plan.layout, quiet
        jobs = plan.left + plan.patients_left
        self.weights = {(job["kind"], job["id"]): job["foretold"]["seconds"] for job in jobs}
        self.total = sum(self.weights.values()) or 1.0
        self.begun, self.shown, self.terminal = time.time(), -1, sys.stderr.isatty()

    def names_in(self, folder):
        try:
            return {entry.name.removesuffix(".json") for entry in os.scandir(os.path.join(self.layout.folder, folder))
                    if entry.name.endswith(".json") and entry.stat().st_mtime >= self.begun - 1}
        except OSError:
            return set()

    def counts(self):
        """(done pairs, failed pairs, share of the work)"""
        done, prepared, failed = (self.names_in(folder) for folder in ("done", "prepared", "failed"))
        ended = {("pair", name) for name in done | failed} | {("prepare", name) for name in prepared}
        share = sum(weight for job, weight in self.weights.items() if job in ended) / self.total
        pairs = [name for kind, name in self.weights if kind == "pair"]
        return sum(name in done for name in pairs), sum(name in failed and name not in done for name in pairs), share

    def show(self):
        if self.quiet:
            return
        done, failed, share = self.counts()
        pairs = sum(kind == "pair" for kind, _ in self.weights)
        left = f", {text_of((time.time() - self.begun) * (1 - share) / share)} left" if share > 0.01 else ""
        line = f"{done} of {pairs} pairs done{f', {failed} failed so far' if failed else ''}{left}"
        if self.terminal:
            print("\r\033[K" + line, end="", file=sys.stderr, flush=True)
        elif int(share * 10) > self.shown:
            self.shown = int(share * 10)
            print(line, file=sys.stderr, flush=True)

    def clear(self):
        if self.terminal and not self.quiet:
            print("\r\033[K", end="", file=sys.stderr, flush=True)
