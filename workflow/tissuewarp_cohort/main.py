"""tissuewarp cohort: checks the table, plans, runs what is not done, and sums up. Started by the program, which has checked
the kinds of the options."""

import argparse
import fcntl
import os
import subprocess
import sys
import time

from . import engine, page, summary
from .check import checked_pairs
from .layout import Layout
from .plan import Plan
from .problems import CohortError, Refused
from .program import read_program
from .progress import text_of


def parsed(arguments):
    parser = argparse.ArgumentParser(prog="tissuewarp cohort", allow_abbrev=False)
    parser.add_argument("table")
    parser.add_argument("--output", required=True)
    parser.add_argument("--jobs", type=int, default=0)
    parser.add_argument("--slurm", default="")
    parser.add_argument("--threads", type=int, default=0)
    parser.add_argument("--devices", default="")
    parser.add_argument("--per-device", type=int, default=1)
    parser.add_argument("--frame", default="")
    parser.add_argument("--dry-run", action="store_true")
    parser.add_argument("--quiet", action="store_true")
    return parser.parse_args(arguments)


def memory_mb():
    """Of this machine: what is available."""
    with open("/proc/meminfo", encoding="ascii") as file:
        fields = dict(line.split(":") for line in file)
    return int(fields["MemAvailable"].split()[0]) // 1024


def settings_of(options):
    devices = [name for name in options.devices.split(",") if name]
    cores = len(os.sched_getaffinity(0))
    if options.slurm:
        return {"slurm": options.slurm, "jobs": options.jobs, "threads": options.threads or 2, "memory_mb": 0,
                "devices": devices, "per_device": options.per_device, "gpus": bool(devices)}
    jobs = options.jobs or (len(devices) * options.per_device if devices else max(1, cores // 2))
    return {"slurm": "", "jobs": jobs, "threads": options.threads or max(1, cores // jobs), "memory_mb": memory_mb(),
            "devices": devices, "per_device": options.per_device, "gpus": bool(devices)}


def take_lock(layout):
    os.makedirs(layout.own, exist_ok=True)
    lock = open(layout.lock, "a", encoding="utf-8")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError as held:
        raise CohortError(f"'{layout.folder}' is being run already; wait for it, or end its tissuewarp cohort and "
                          "the snakemake that it started") from held
    return lock


def end_arrays_of_earlier_starts(layout):
    """Arrays that outlived a start which was killed: their jobs would be run twice."""
    folder = os.path.join(layout.own, "slurm", "arrays")
    for name in os.listdir(folder) if os.path.isdir(folder) else []:
        subprocess.run(["scancel", name.removesuffix(".json")], capture_output=True)
        os.unlink(os.path.join(folder, name))


def words_of(plan, notes):
    left, total = len(plan.left), plan.foretold()
    settings = plan.settings
    at_once = settings["jobs"] or 1
    cores = settings["threads"] if settings["slurm"] else min(at_once * settings["threads"], os.cpu_count() or 1)
    seconds = total["seconds"] * 2 / max(1, cores)
    lines = [f"{len(plan.pairs)} pairs, {len(plan.pairs) - left} done, {left} left",
             f"{len(plan.patients_left)} patients to prepare once for several pairs",
             f"foretold: {text_of(total['seconds'] * 2)} of one core, " +
             (f"{text_of(seconds / at_once)} with {at_once} at once" if settings["slurm"] else f"{text_of(seconds)} here") +
             f"; at most {total['memory_mb']} MB a job; {total['bytes'] / 1e9:.1f} GB on disk",
             f"from {plan.scale.runs} runs of this cohort" if plan.scale.runs else
             "from headers alone: the first pairs will tell better"]
    return "\n".join([*lines, *(f"note: {note}" for note in notes)])


def write_summary(layout, jobs, table, program, frame):
    rows = summary.rows_of(layout, jobs)
    groups = ""
    if any(any(job["patients"]) for job in jobs):
        from . import groups as of_groups  # needs numpy, which a table without groups does not
        groups = of_groups.write(layout, jobs, frame)
    summary.write_tables(layout, rows)
    about = f"{layout.folder}, tissuewarp {program.version}, {time.strftime('%Y-%m-%d %H:%M')}"
    page.write(layout, rows, f"Cohort of {table}", about, groups)
    return rows


def run(options, program_path):
    program = read_program(program_path)
    layout, settings = Layout(options.output), settings_of(options)
    pairs, notes = checked_pairs(options.table, program, len(os.sched_getaffinity(0)))
    if options.frame and options.frame not in {name for pair in pairs for name in pair.patients}:
        raise CohortError(f"--frame '{options.frame}' is no patient of the columns 'from' and 'to'; name one of these", 2)
    plan = Plan(layout, pairs, program, settings)
    if options.dry_run:
        print(words_of(plan, notes))
        return 0
    engine.require_engine(settings)
    lock = take_lock(layout)
    if not options.quiet:
        print(words_of(plan, notes), file=sys.stderr)
    if settings["slurm"]:
        end_arrays_of_earlier_starts(layout)
    plan.write()
    return finish(plan, options, program, lock)


def finish(plan, options, program, lock):
    layout, interrupted, code = plan.layout, False, 0
    try:
        code = engine.run(plan, str(int(time.time())), lock, options.quiet) if plan.left else 0
    except engine.Interrupted:
        interrupted = True
    rows = write_summary(layout, plan.pairs, options.table, program, options.frame)
    count = {state: sum(row["state"] == state for row in rows) for state in ("done", "failed", "left")}
    print(f"{count['done']} of {len(rows)} pairs done, {count['failed']} failed; {layout.page}")
    for row in [row for row in rows if row["state"] == "failed"][:20]:
        print(f"  {row['id']} (row {row['row']}): {row['why']}", file=sys.stderr)
    if interrupted:
        raise CohortError(f"interrupted; {count['done']} pairs are done, and the same command goes on from there", 130)
    if count["failed"] or count["left"]:
        why = "" if count["failed"] else f"; Snakemake's last words: {engine.last_words(layout)}"
        raise CohortError(f"{count['failed']} pairs failed and {count['left']} were not run{why}; the same command tries "
                          f"these again (logs are in '{os.path.join(layout.folder, 'logs')}')", 4)
    return 0 if code == 0 else 1


def counted(problems):
    return "1 problem" if len(problems) == 1 else f"{len(problems)} problems"


def main(arguments, program_path):
    try:
        return run(parsed(arguments), program_path)
    except Refused as refused:
        print(f"{refused}\ntissuewarp cohort: {counted(refused.problems)} in the table; nothing was run",
              file=sys.stderr)
        return 2
    except CohortError as failure:
        print(f"tissuewarp cohort: {failure}", file=sys.stderr)
        return failure.code
    except engine.Interrupted:
        return 130
