"""Cohorts whose pairs link patients (columns `from` and `to`): the mean displacement and shape in one patient's frame, and
how far loops of registrations miss their beginning. Maps are composed point by point; no field is resampled."""

import collections
import csv
import functools
import html
import itertools
import os

import numpy

from .digests import read_json
from .fields import Field, places_of, read_nifti, sampled, write_nifti

MOST_LOOPS = 500
POINTS_OF_A_LOOP = 5000
CHUNK = 400_000  # points carried at a time
FIXED_POINT_ROUNDS = 30


class Atlas:
    """Patients as nodes, done pairs as links that can be walked both ways."""

    def __init__(self, layout, jobs):
        self.layout, self.links, self.labels = layout, {}, {}
        for job in jobs:
            source, target = job["patients"]
            if not (source and target) or source == target or read_json(layout.record("pair", job["id"])) is None:
                continue
            folder = layout.pair(job["id"])
            self.links.setdefault((source, target), os.path.join(folder, "displacement_moving_to_fixed.nii.gz"))
            self.links.setdefault((target, source), os.path.join(folder, "displacement_fixed_to_moving.nii.gz"))
            for patient, role in ((source, "moving-labels"), (target, "fixed-labels")):
                for path in job["files"].get(role, []):
                    if path.endswith((".nii", ".nii.gz")):
                        self.labels.setdefault(patient, path)

    def patients(self):
        return sorted({name for link in self.links for name in link})

    @functools.lru_cache(maxsize=6)
    def field(self, link):
        return Field(self.links[link])

    def chain(self, start, end):
        """The fewest links from start to end, first by name among equals; None where they are not linked."""
        came, queue = {start: None}, collections.deque([start])
        while queue:
            here = queue.popleft()
            if here == end:
                names = [end]
                while came[names[-1]] is not None:
                    names.append(came[names[-1]])
                return list(itertools.pairwise(reversed(names)))
            for source, target in sorted(self.links):
                if source == here and target not in came:
                    came[target] = here
                    queue.append(target)
        return None

    def carry(self, links, places):
        for link in links:
            places = self.field(link)(places)
        return places

    def tissue(self, patient):
        """Places of the patient's own label map that are tissue, LPS mm; of a field's grid where it has none."""
        if patient in self.labels:
            values, matrix = read_nifti(self.labels[patient])
            return places_of(values.shape, matrix)[values[..., 0].reshape(-1, order="F") > 0]
        field = self.field(next(link for link in sorted(self.links) if link[0] == patient))
        return places_of(field.values.shape, field.matrix)

    def loops(self):
        """A→B→C→A of three pairs, each once, from its first name on."""
        names = self.patients()
        for a, b, c in itertools.combinations(names, 3):
            if {(a, b), (b, c), (c, a)} <= set(self.links):
                yield a, b, c


def loop_row(atlas, loop):
    places = atlas.tissue(loop[0])
    places = places[::max(1, len(places) // POINTS_OF_A_LOOP)]
    links = list(itertools.pairwise([*loop, loop[0]]))
    miss = numpy.linalg.norm(atlas.carry(links, places) - places, axis=1)
    known = miss[numpy.isfinite(miss)]
    row = {"loop": " → ".join([*loop, loop[0]]), "points": len(known), "left_the_grid": len(miss) - len(known)}
    if len(known):
        row.update(mean_mm=known.mean(), median_mm=numpy.median(known), percentile_95_mm=numpy.percentile(known, 95),
                   maximum_mm=known.max())
    return row


LOOP_COLUMNS = ["loop", "points", "left_the_grid", "mean_mm", "median_mm", "percentile_95_mm", "maximum_mm"]


def write_loops(atlas, folder):
    rows = [loop_row(atlas, loop) for loop in itertools.islice(atlas.loops(), MOST_LOOPS)]
    rows.sort(key=lambda row: -row.get("mean_mm", 0))
    with open(os.path.join(folder, "loops.csv"), "w", encoding="utf-8") as file:
        table = csv.DictWriter(file, LOOP_COLUMNS, lineterminator="\n")
        table.writeheader()
        table.writerows(rows)
    return rows


def mean_displacement(atlas, frame, chains, places):
    """(mean, deviation, count) of φ(y) − y over the frame's own 0 and every patient whose chain knows y; LPS mm."""
    total, squares, count = numpy.zeros_like(places), numpy.zeros_like(places), numpy.ones(len(places))
    for chain in chains.values():
        moved = atlas.carry(chain, places) - places
        known = numpy.isfinite(moved).all(axis=1)
        total[known] += moved[known]
        squares[known] += moved[known] ** 2
        count[known] += 1
    mean = total / count[:, None]
    variance = numpy.maximum(squares / count[:, None] - mean ** 2, 0).sum(axis=1)
    return mean, numpy.sqrt(variance), count


def shape_of(labels, matrix, mean):
    """Labels of the frame's patient carried by the mean displacement: each voxel asks where its tissue was."""
    places = places_of(labels.shape, matrix)
    to_index = numpy.linalg.inv(matrix)
    found = places.copy()
    for _ in range(FIXED_POINT_ROUNDS):
        moved = sampled(mean, found @ to_index[:3, :3].T + to_index[:3, 3])
        found = places - numpy.nan_to_num(moved)
    index = numpy.rint(found @ to_index[:3, :3].T + to_index[:3, 3]).astype(int)
    inside = numpy.all((index >= 0) & (index < labels.shape[:3]), axis=1)
    result = numpy.zeros(len(places), labels.dtype)
    result[inside] = labels[tuple(index[inside].T)][..., 0]
    return result.reshape(labels.shape[:3], order="F")


def write_mean(atlas, frame, folder):
    """Words on what was written."""
    chains = {name: atlas.chain(frame, name) for name in atlas.patients() if name != frame}
    lost = sorted(name for name, chain in chains.items() if chain is None)
    chains = {name: chain for name, chain in chains.items() if chain}
    if not chains:
        return f"No done pair links {frame} to another patient: there is no mean."
    if frame in atlas.labels:
        labels, matrix = read_nifti(atlas.labels[frame])
        shape = labels.shape[:3]
    else:
        field = atlas.field(chains[min(chains)][0])
        labels, matrix, shape = None, field.matrix, field.values.shape[:3]
    places = places_of(shape, matrix)
    parts = [mean_displacement(atlas, frame, chains, places[first:first + CHUNK]) for first in range(0, len(places), CHUNK)]
    mean, deviation, count = (numpy.concatenate(part) for part in zip(*parts))
    mean = mean.reshape(*shape, 3, order="F").astype(numpy.float32)
    write_nifti(os.path.join(folder, "mean_displacement.nii.gz"), mean, matrix, vectors=True)
    for name, values in (("deviation", deviation), ("patients", count)):
        write_nifti(os.path.join(folder, name + ".nii.gz"), values.reshape(shape, order="F").astype(numpy.float32), matrix)
    if labels is not None:
        values = shape_of(labels, matrix, mean)
        write_nifti(os.path.join(folder, "mean_shape.nii.gz"), values.astype(numpy.int16), matrix)
    words = f"Mean of {len(chains) + 1} patients in the frame of {frame}: group/mean_displacement.nii.gz, deviation, patients"
    words += ", mean_shape" if labels is not None else f"; no mean shape, since {frame} has no label map as NIfTI"
    return words + (f". Not linked to it: {', '.join(lost)}." if lost else ".")


def table_of(rows):
    if not rows:
        return "<p>No three patients are linked in a loop.</p>"
    head = "".join(f"<th>{html.escape(name.replace('_', ' '))}</th>" for name in LOOP_COLUMNS)
    def cell(value):
        return html.escape(f"{value:.3f}" if isinstance(value, float) else str(value))

    body = "".join("<tr>" + "".join(f"<td>{cell(row.get(name, '–'))}</td>" for name in LOOP_COLUMNS) + "</tr>"
                   for row in rows[:100])
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def write(layout, jobs, frame):
    """Writes group/ and returns what the page says of it."""
    atlas, folder = Atlas(layout, jobs), os.path.join(layout.folder, "group")
    os.makedirs(folder, exist_ok=True)
    rows = write_loops(atlas, folder)
    words = write_mean(atlas, frame, folder) if frame else "No mean was asked for (--frame)."
    return (f"<p>{html.escape(words)}</p><p><small>How far a point of the first patient's tissue is from where it began after "
            f"three registrations: a check that needs no truth. All loops: group/loops.csv.</small></p>{table_of(rows)}")
