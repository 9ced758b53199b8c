"""Cells that name files of a BIDS dataset by entities: `bids:FOLDER:sub-01_ses-pre_T1w`.

Entities that are not named may be anything. A row whose id holds `*` stands for every subject of the dataset:
`sub-*` in its cells is the subject, `*` in its id too."""

import os
import re

from .problems import Problem
from .table import Row

PREFIX = "bids:"
ENDS = (".nii", ".nii.gz")


class Dataset:
    """Images below a folder by their entities; read once."""

    def __init__(self, folder):
        self.files = []  # (entities, suffix, path)
        for place, folders, names in os.walk(folder):
            folders.sort()
            folders[:] = [name for name in folders if not name.startswith(".")]
            for name in sorted(names):
                stem = next((name[:-len(end)] for end in ENDS if name.endswith(end)), None)
                if stem is not None:
                    *parts, suffix = stem.split("_")
                    entities = dict(part.partition("-")[::2] for part in parts if "-" in part)
                    self.files.append((entities, suffix, os.path.join(place, name)))

    def subjects(self):
        return sorted({entities["sub"] for entities, _, _ in self.files if "sub" in entities})

    def find(self, pattern):
        *parts, last = pattern.split("_")
        if "-" in last:
            parts, last = [*parts, last], None
        wanted = dict(part.partition("-")[::2] for part in parts)
        return [path for entities, suffix, path in self.files
                if (last is None or suffix == last) and all(entities.get(k) == v for k, v in wanted.items())]


class Datasets:
    def __init__(self, base):
        self.base, self.known = base, {}

    def of(self, cell):
        """(dataset or None, pattern)"""
        folder, _, pattern = cell.removeprefix(PREFIX).rpartition(":")
        folder = os.path.join(self.base, folder)
        if folder not in self.known:
            self.known[folder] = Dataset(folder) if os.path.isdir(folder) else None
        return self.known[folder], pattern


def subjects_of(row, datasets):
    for cell in row.cells.values():
        if cell.startswith(PREFIX) and "sub-*" in cell:
            dataset, _ = datasets.of(cell)
            return dataset.subjects() if dataset else []
    return []


def expand(rows, datasets):
    """Rows whose id holds * for each subject."""
    result, problems = [], []
    for row in rows:
        if "*" not in row.id:
            result.append(row)
            continue
        subjects = subjects_of(row, datasets)
        if not subjects:
            problems.append(Problem(row.number, "id", row.id, "stands for subjects, and no cell of the row names any",
                                    "write for instance bids:FOLDER:sub-*_ses-pre_T1w"))
        for subject in subjects:
            cells = {name: cell.replace("sub-*", f"sub-{subject}") for name, cell in row.cells.items()}
            result.append(Row(row.number, row.id.replace("*", subject), cells))
    return result, problems


def resolve(row, column, cell, datasets):
    """(path, problem) of one cell."""
    dataset, pattern = datasets.of(cell)
    if dataset is None:
        return None, Problem(row.number, column, cell, "names no folder", "write bids:FOLDER:ENTITIES_SUFFIX")
    if not re.fullmatch(r"[A-Za-z0-9-]+(_[A-Za-z0-9-]+)*", pattern):
        return None, Problem(row.number, column, cell, "has no entities", "write for instance bids:FOLDER:sub-01_T1w")
    found = dataset.find(pattern)
    if len(found) == 1:
        return found[0], None
    if not found:
        return None, Problem(row.number, column, cell, "no image of the dataset has these entities",
                             "look for their spelling, or leave one out")
    names = ", ".join(os.path.basename(path) for path in found[:3])
    return None, Problem(row.number, column, cell, f"{len(found)} images have these entities ({names}, …)",
                         "name the entity that tells them apart")
