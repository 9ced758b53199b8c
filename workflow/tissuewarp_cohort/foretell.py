"""What a job will take, from headers alone, until runs of the same cohort say more.

The figures are those of `register` on data/brainshift (6.3 million voxels, 50 000 tetrahedra, two cores of a shared
machine, commit 67d1c95): 20 s, 0.7 GB, 75 MB written; memory also of fourteen real pairs, of which images of 17 million voxels
took most, 3.1 GB. They are rounded up; docs/manual/cohort.md, "What is asked for"."""

import json
import os
import statistics

SECONDS_START, SECONDS_PER_MVOXEL, SECONDS_PER_KTET = 3.0, 0.8, 0.12
MB_START, MB_PER_MVOXEL, MB_PER_MVOXEL_MATCHED, MB_PER_KTET = 300.0, 30.0, 170.0, 4.0
OTHER_DATA = {"fixed-labels", "fixed-surface", "fixed-points", "fixed-curves"}  # with these images are matched on request
BYTES_PER_VOXEL, BYTES_START = 9.0, 4e6
UNSEEN_VOXELS = 1_000_000  # of a surface or mesh without an image: a hundredth of its size in each direction
ORGAN_SHARE = 0.3  # of the moving grid, where an edge length is given and no label is read
HEADROOM = 1.5  # what is asked for, above what is foretold


def thousands_of_tetrahedra(pair):
    edge = float(pair.options.get("edge-length", ["0"])[0])
    usual = 50.0 if "fixed-labels" in pair.files else 15.0
    if edge <= 0:
        return usual
    volume = ORGAN_SHARE * (pair.voxels[0] or UNSEEN_VOXELS) * pair.voxel_mm3
    return min(2000.0, max(1.0, 8.5 * volume / edge ** 3 / 1000))


def matches_images(pair):
    return "fixed" in pair.files and ("match-image" in pair.options or not OTHER_DATA & set(pair.files))


def of_pair(pair):
    """(seconds on two cores, MB of memory, bytes written)"""
    voxels = sum(pair.voxels) or 2 * UNSEEN_VOXELS
    tetrahedra = thousands_of_tetrahedra(pair)
    seconds = SECONDS_START + SECONDS_PER_MVOXEL * voxels / 1e6 + SECONDS_PER_KTET * tetrahedra
    if "time-budget" in pair.options or "accuracy" in pair.options:
        seconds *= 2
    for_voxels = MB_PER_MVOXEL_MATCHED if matches_images(pair) else MB_PER_MVOXEL
    memory = MB_START + for_voxels * voxels / 1e6 + MB_PER_KTET * tetrahedra
    return seconds, memory, BYTES_START + BYTES_PER_VOXEL * voxels / 2


def wall_seconds(seconds, threads):
    """What takes so long on two cores; more than two are not counted on."""
    return seconds * (2 if threads == 1 else 1)


class Scale:
    """What runs of this cohort took, over what was foretold for them; 1 before there are any."""

    def __init__(self, folder):
        self.seconds, self.memory, self.runs = 1.0, 1.0, 0
        ratios = [], []
        for record in records_of(folder, 200):
            told, took = record.get("foretold"), record.get("took")
            if told and took and told["seconds"] > 0 and took.get("memory_mb"):
                ratios[0].append(took["seconds"] * min(2, took.get("threads", 2)) / 2 / told["seconds"])
                ratios[1].append(took["memory_mb"] / told["memory_mb"])
        if len(ratios[0]) >= 5:
            self.runs = len(ratios[0])
            self.seconds, self.memory = (max(0.2, statistics.median(values)) for values in ratios)


def records_of(folder, most):
    """The first records of done pairs."""
    try:
        names = sorted(name for name in os.listdir(os.path.join(folder, "done")) if name.endswith(".json"))[:most]
    except OSError:
        return
    for name in names:
        try:
            with open(os.path.join(folder, "done", name), encoding="utf-8") as file:
                yield json.load(file)
        except (OSError, ValueError):
            continue
