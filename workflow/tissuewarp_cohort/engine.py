"""Starts Snakemake on a written plan, shows progress, and ends it whole when interrupted."""

import os
import shutil
import signal
import subprocess
import time

from .problems import CohortError
from .progress import Progress

WORKFLOW = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
PATIENCE_S = 20  # between asking jobs to end and ending them


def require_engine(settings):
    wanted = ["snakemake", *(["sbatch", "squeue", "scontrol", "scancel"] if settings["slurm"] else [])]
    missing = [name for name in wanted if shutil.which(name) is None]
    if missing:
        raise CohortError(f"{', '.join(missing)} cannot be found; install Debian's packages snakemake"
                          f"{' and slurm-client' if settings['slurm'] else ''}, or load your cluster's modules")


def command_of(plan, session):
    settings = plan.settings
    command = ["snakemake", "--snakefile", os.path.join(WORKFLOW, "Snakefile"), "--profile",
               os.path.join(WORKFLOW, "profiles", "slurm" if settings["slurm"] else "local"),
               "--directory", plan.layout.own, "--config", f"session={session}"]
    if settings["slurm"]:
        return [*command, "--cores", "64"]  # arrays that are waited for at a time
    resources = [f"mem_mb={settings['memory_mb']}"]
    if settings["devices"]:
        resources.append(f"gpu={len(settings['devices']) * settings['per_device']}")
    return [*command, "--cores", str(settings["jobs"] * settings["threads"]), "--resources", *resources]


class Interrupted(Exception):
    pass


def interrupt(_signal, _frame):
    raise Interrupted


def end(child):
    """All of its jobs, and itself."""
    for number in (signal.SIGTERM, signal.SIGKILL):
        try:
            os.killpg(child.pid, number)
        except ProcessLookupError:
            return
        until = time.time() + PATIENCE_S
        while time.time() < until and group_lives(child):
            time.sleep(0.1)


def group_lives(child):
    child.poll()
    try:
        os.killpg(child.pid, 0)
        return True
    except ProcessLookupError:
        return False


def run(plan, session, lock, quiet):
    """Runs what is left. `lock` stays held while any of it runs. Throws Interrupted."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, interrupt)
    progress = Progress(plan, quiet)
    environment = {**os.environ, "XDG_CACHE_HOME": os.path.join(plan.layout.own, "cache"), "PYTHONDONTWRITEBYTECODE": "1"}
    with open(plan.layout.log, "a", encoding="utf-8") as log:
        child = subprocess.Popen(command_of(plan, session), stdin=subprocess.DEVNULL, stdout=log, stderr=log,
                                 start_new_session=True, pass_fds=[lock.fileno()], env=environment)
        try:
            while child.poll() is None:
                progress.show()
                time.sleep(0.5)
        except Interrupted:
            for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                signal.signal(number, signal.SIG_IGN)
            progress.clear()
            end(child)
            raise
    progress.show()
    progress.clear()
    return child.returncode


def last_words(layout):
    with open(layout.log, encoding="utf-8", errors="replace") as log:
        lines = [line.strip() for line in log if line.strip()]
    return lines[-1] if lines else "it said nothing"
