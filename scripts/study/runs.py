"""Runs of the programs that are compared, each in a folder of its own, scored alike and not run twice."""

import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import sys

from . import fields, measured, scoring
from .tools import Machine


def install_package(package):
    """Installs a peer's Debian package when its program, of the same name, is missing."""
    if not package or shutil.which(package):
        return
    as_root = [] if os.geteuid() == 0 else ["sudo"]
    if as_root and not shutil.which("sudo"):
        sys.exit(f"run as root, or install sudo; missing Debian package: {package}")
    print(f"Installing the Debian package {package}", file=sys.stderr)
    apt = [*as_root, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "-qq"]
    subprocess.run([*apt, "update"], check=True, stdout=subprocess.DEVNULL)
    subprocess.run([*apt, "install", "-y", "--no-install-recommends", package], check=True, stdout=subprocess.DEVNULL)


def slug(name):
    return "-".join("".join(c if c.isalnum() else " " for c in name).split())


def fingerprint(tool, threads):
    """What a finished run must share with a wanted one: the contents of inputs and settings, and the options."""
    digest = hashlib.sha256(f"{type(tool).__name__} {threads}".encode())
    values = [part for value in vars(tool).values() for part in (value if isinstance(value, list) else [value])]
    for part in [*values, *tool.settings]:
        digest.update(part.read_bytes() if isinstance(part, pathlib.Path) else f" {part} ".encode())
    return digest.hexdigest()


def score(case, tool, folder):
    """Errors at every set of targets and the worst share of folds among the fields that the tool wrote."""
    field, affine = fields.read_field(tool.backward(folder))
    if not fields.finite(field):
        raise ValueError("the field holds values that are not finite")
    targets = {name: scoring.score_backward(field, affine, *points) for name, points in case.targets.items()}
    folds = [fields.folded_share(field, affine, fields.organ_mask(case.fixed_organ, field.shape[:3], affine))]
    if tool.forward(folder):
        field, affine = fields.read_field(tool.forward(folder))
        folds.append(fields.folded_share(field, affine, fields.organ_mask(case.moving_organ, field.shape[:3], affine)))
    return dict(targets=targets, folded={where: max(fold[where] for fold in folds) for where in ("organ", "grid")})


def run_commands(commands, folder, limit):
    """Seconds of all commands, their highest peak, and why the last one failed, if it did."""
    total = dict(seconds=0.0, cpu_seconds=0.0, peak_mb=0.0, failure=None)
    for number, (command, environment) in enumerate(commands):
        took = measured.run(command, folder / f"log-{number}.txt", environment, limit)
        total["seconds"] += took["seconds"]
        total["cpu_seconds"] += took["cpu_seconds"]
        total["peak_mb"] = max(total["peak_mb"], took["peak_mb"])
        if took["exit_code"] != 0:
            total["failure"] = f"{pathlib.Path(command[0]).name} ended with {took['exit_code']}"
            break
    return total


def remove_outputs(folder):
    """Everything but results, logs and command files."""
    for path in folder.iterdir():
        if path.is_dir():
            shutil.rmtree(path)
        elif path.suffix not in (".json", ".txt", ".log"):
            path.unlink()


def run(case, tool, folder, options):
    """Leaves result.json in the folder: seconds, peak memory, failure or errors by targets and folds. Options are the program,
    threads, limit in seconds, again, and keep (the fields)."""
    finished, key = folder / "result.json", fingerprint(tool, options.threads)
    if finished.exists() and json.loads(finished.read_text())["key"] == key and not options.again:
        return
    install_package(tool.package)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    commands = tool.commands(folder, Machine(options.program, options.threads))
    result = run_commands(commands, folder, options.limit) | dict(key=key, threads=options.threads)
    if not result["failure"]:
        try:
            result |= score(case, tool, folder)
        except (OSError, ValueError) as error:
            result["failure"] = f"no usable field: {error}"
    if not options.keep:
        remove_outputs(folder)
    finished.write_text(json.dumps(result, indent=1))
