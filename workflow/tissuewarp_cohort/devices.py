"""GPUs of one host, by their EGL index: each is lent to as many jobs at a time as --per-device says."""

import contextlib
import fcntl
import os
import time

from .digests import read_json

WAIT_S = 0.2


def of_slurm():
    """The GPU that Slurm gave this job, if it gave one."""
    given = os.environ.get("SLURM_STEP_GPUS") or os.environ.get("SLURM_JOB_GPUS") or ""
    return [index for index in given.split(",") if index.isdigit()]


def slots(settings):
    """(device, number of the slot), devices first, so that jobs spread before they share."""
    given = [f"gpu:{index}" for index in of_slurm()] or settings["devices"]
    return [(device, slot) for slot in range(settings["per_device"]) for device in given]


@contextlib.contextmanager
def taken(layout, wanted):
    """A device of the plan for a job that asks for "gpu", until the job ends; what else it asks for is as it is."""
    settings = (read_json(layout.plan) or {}).get("settings", {"devices": [], "per_device": 1})
    choices = slots(settings) if wanted == "gpu" else []
    if not choices:
        yield ""
        return
    folder = os.path.join(layout.own, "devices")
    os.makedirs(folder, exist_ok=True)
    while True:
        for device, slot in choices:
            with open(os.path.join(folder, f"{os.uname().nodename}-{device.replace(':', '-')}-{slot}"), "w") as lock:
                try:
                    fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    continue
                yield device
                return
        time.sleep(WAIT_S)
