#!/usr/bin/python3
"""Draws a slice of the tissue at rest and in the last frame of what `tissuewarp simulate` wrote:
    plot_scene.py FOLDER AXIS POSITION_MM FIGURE.svg
The slice is cut at rest, across AXIS (x, y or z) at POSITION_MM, and its points are drawn where they end up; colours are labels
on the left and the size of the displacement on the right."""
import pathlib
import sys

import h5py
import numpy as np

EDGES = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
LABELS = ["#cbd5e1", "#93c5fd", "#fca5a5", "#86efac", "#fde68a", "#d8b4fe"]
# From still to far: dark blue, green, yellow.
COLOURS = np.array([[49, 46, 129], [13, 148, 136], [253, 224, 71]])
WIDTH, MARGIN = 430, 26


def read(folder):
    with h5py.File(pathlib.Path(folder) / "displacement.h5") as record:
        tets, labels = record["mesh/tetrahedra"][:], record["mesh/labels"][:]
        stage = int(record["stage"][-1])
        kept = record[f"remaining/{stage}"][:] if f"remaining/{stage}" in record else np.arange(len(tets))
        return record["mesh/nodes"][:], tets, labels, record["displacement"][-1], kept


def slice_of(nodes, tets, axis, position):
    """Polygons of the tetrahedra that the plane cuts: lists of (node, node, part), and the tetrahedron of each."""
    side = nodes[:, axis] - position + 1e-9
    polygons = []
    for place, tet in enumerate(tets):
        cuts = [(tet[a], tet[b], side[tet[a]] / (side[tet[a]] - side[tet[b]]))
                for a, b in EDGES if side[tet[a]] * side[tet[b]] < 0]
        if len(cuts) > 2:
            polygons.append((place, cuts))
    return polygons


def corners(cuts, values):
    a, b, part = (np.array(column) for column in zip(*cuts))
    return values[a] + part[:, None] * (values[b] - values[a])


def colour(part):
    x = min(max(part, 0.0), 1.0) * (len(COLOURS) - 1)
    low = min(int(x), len(COLOURS) - 2)
    rgb = COLOURS[low] + (x - low) * (COLOURS[low + 1] - COLOURS[low])
    return "#" + "".join(f"{round(v):02x}" for v in rgb)


def polygon(points, fill):
    centre = points.mean(axis=0)
    around = np.argsort(np.arctan2(*(points - centre).T))
    path = " ".join(f"{x:.1f},{y:.1f}" for x, y in points[around])
    return f'<polygon points="{path}" fill="{fill}"/>'


def text(x, y, content, anchor="start"):
    return f'<text x="{x:.0f}" y="{y:.0f}" font-size="12" font-family="sans-serif" text-anchor="{anchor}" fill="#111827">{content}</text>'


def figure(folder, axis, position):
    nodes, tets, labels, displacement, kept = read(folder)
    shown = [c for c in range(3) if c != axis]
    moved = nodes + np.nan_to_num(displacement)
    size = np.linalg.norm(np.nan_to_num(displacement), axis=1)
    both = np.vstack([nodes, moved])[:, shown]
    low, high = both.min(axis=0), both.max(axis=0)
    scale = (WIDTH - 2 * MARGIN) / max(high - low)
    height = (high - low)[1] * scale + 2 * MARGIN + 30
    # Superior, or anterior, is up: z grows upwards in a picture of LPS, y downwards.
    flip = shown[1] == 2

    def place(points, panel):
        x = MARGIN + (points[:, 0] - low[0]) * scale + panel * WIDTH
        y = (high[1] - points[:, 1] if flip else points[:, 1] - low[1]) * scale
        return np.column_stack([x, y + MARGIN + 10])

    cut = slice_of(nodes, tets, axis, position)
    remains, largest = set(kept.tolist()), size.max()
    order = {label: i for i, label in enumerate(sorted(set(labels.tolist())))}
    parts = [text(MARGIN, 18, "at rest, labels"), text(WIDTH + MARGIN, 18, f"at the end, displacement 0 to {largest:.1f} mm")]
    for tet, cuts in cut:
        parts.append(polygon(place(corners(cuts, nodes)[:, shown], 0), LABELS[order[labels[tet]] % len(LABELS)]))
        if tet in remains:
            mean = corners(cuts, size[:, None]).mean()
            parts.append(polygon(place(corners(cuts, moved)[:, shown], 1), colour(mean / largest if largest > 0 else 0)))
    for i in range(60):
        parts.append(f'<rect x="{WIDTH + MARGIN + 3 * i}" y="{height - 16:.0f}" width="3.2" height="8" fill="{colour(i / 59)}"/>')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {2 * WIDTH} {height:.0f}" shape-rendering="crispEdges">'
            f'<rect width="100%" height="100%" fill="white"/>{"".join(parts)}</svg>\n')


def main():
    if len(sys.argv) != 5 or sys.argv[2] not in "xyz":
        sys.exit(__doc__)
    folder, axis, position, target = sys.argv[1:]
    pathlib.Path(target).write_text(figure(folder, "xyz".index(axis), float(position)), encoding="utf-8")


if __name__ == "__main__":
    main()
