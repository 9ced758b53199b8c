"""Digests of files, and whether what lies there is what was written: size and time first, SHA-256 where these differ."""

import hashlib
import json
import os
import tempfile

COMPANIONS = {".mhd": ("elementdatafile", "="), ".nhdr": ("data file", ":")}


def sha256_of(path):
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest()


def parts_of(path):
    """The files that make up what a path names: of a folder those in it, of a header the voxels beside it too."""
    if os.path.isdir(path):
        return sorted(entry.path for entry in os.scandir(path) if entry.is_file())
    key, sign = COMPANIONS.get(os.path.splitext(path)[1].lower(), (None, None))
    if key is None:
        return [path]
    with open(path, "rb") as file:
        lines = file.read(1 << 16).decode("latin-1").splitlines()
    beside = [line.partition(sign)[2].strip() for line in lines if line.lower().startswith(key)]
    beside = [os.path.join(os.path.dirname(path), name) for name in beside]
    return [path, *[name for name in beside if os.path.isfile(name)]]


def stamp_of(path):
    """[[size, time in ns], …] of its parts: what changes when somebody writes to it."""
    return [[os.stat(part).st_size, os.stat(part).st_mtime_ns] for part in parts_of(path)]


def digest_of(path):
    parts = parts_of(path)
    if len(parts) == 1:
        return sha256_of(parts[0])
    whole = hashlib.sha256()
    for part in parts:
        whole.update(f"{os.path.basename(part)} {sha256_of(part)}\n".encode())
    return whole.hexdigest()


def entry_of(path):
    return {"stamp": stamp_of(path), "sha256": digest_of(path)}


def is_as_recorded(path, entry):
    try:
        return stamp_of(path) == entry["stamp"] or digest_of(path) == entry["sha256"]
    except OSError:
        return False


def digest_of_json(value):
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()


def write_json(path, value):
    """As a whole or not at all."""
    os.makedirs(os.path.dirname(path), exist_ok=True)
    handle, name = tempfile.mkstemp(dir=os.path.dirname(path), prefix=".partial-")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(value, file, indent=1)
        os.replace(name, path)
    except BaseException:
        if os.path.exists(name):
            os.unlink(name)
        raise


def read_json(path):
    """None where there is none, or no whole one."""
    try:
        with open(path, encoding="utf-8") as file:
            return json.load(file)
    except (OSError, ValueError):
        return None
