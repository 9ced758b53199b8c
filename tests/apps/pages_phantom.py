"""A folder with every file that the README and the pages for users name in their commands, made of one small phantom."""

import pathlib

import numpy

from compound_test import Sweep, plus_configuration
from phantom import CENTRE_LPS, FIXED_AFFINE, FIXED_AXES, MOVING_AFFINE, MOVING_AXES, SHIFT_LPS, ellipsoid, save


def sphere(rings=8, columns=16):
    """Points of a unit sphere, and triangles that face outwards."""
    points = [[0, 0, 1.0]]
    for ring in range(1, rings):
        a = numpy.pi * ring / rings
        points += [[numpy.sin(a) * numpy.cos(b), numpy.sin(a) * numpy.sin(b), numpy.cos(a)]
                   for b in 2 * numpy.pi * numpy.arange(columns) / columns]
    points.append([0, 0, -1.0])

    def at(ring, column):
        return 1 + (ring - 1) * columns + column % columns

    triangles = [[0, at(1, c), at(1, c + 1)] for c in range(columns)]
    for ring in range(1, rings - 1):
        for c in range(columns):
            triangles += [[at(ring, c), at(ring + 1, c), at(ring + 1, c + 1)],
                          [at(ring, c), at(ring + 1, c + 1), at(ring, c + 1)]]
    last = len(points) - 1
    triangles += [[last, at(rings - 1, c + 1), at(rings - 1, c)] for c in range(columns)]
    return numpy.array(points), numpy.array(triangles)


def write_ply(path, points, triangles):
    header = ["ply", "format ascii 1.0", f"element vertex {len(points)}", "property float x", "property float y",
              "property float z", f"element face {len(triangles)}", "property list uchar int vertex_indices", "end_header"]
    lines = ["{:.4f} {:.4f} {:.4f}".format(*p) for p in points] + ["3 {} {} {}".format(*t) for t in triangles]
    path.write_text("\n".join(header + lines) + "\n")


def write_lines(path, points):
    """One polyline of legacy VTK."""
    numbers = " ".join(map(str, range(len(points))))
    path.write_text(f"# vtk DataFile Version 3.0\nvessel\nASCII\nDATASET POLYDATA\nPOINTS {len(points)} float\n"
                    + "\n".join("{:.4f} {:.4f} {:.4f}".format(*p) for p in points)
                    + f"\nLINES 1 {len(points) + 1}\n{len(points)} {numbers}\n")


def write_table(path, header, rows):
    path.write_text(header + "\n" + "\n".join(",".join(f"{value:.4f}" for value in row) for row in rows) + "\n")


def write_elastix(path, points):
    path.write_text(f"point\n{len(points)}\n" + "\n".join("{:.4f} {:.4f} {:.4f}".format(*p) for p in points) + "\n")


def carry(points):
    """Where points of the moving ellipsoid are in the fixed one."""
    return (points - CENTRE_LPS) / MOVING_AXES * FIXED_AXES + CENTRE_LPS + SHIFT_LPS


def write_images(folder):
    for name, affine, centre, axes in (("preop", MOVING_AFFINE, CENTRE_LPS, MOVING_AXES),
                                       ("intraop", FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, FIXED_AXES)):
        labels, grey = ellipsoid(affine, centre, axes)
        other, _ = ellipsoid(affine, centre + axes * [0.55, 0, 0], 0.3 * axes)
        labels[other > 0] = 3
        grey = grey + 30 * (labels == 2) + 50 * (labels == 3)
        save(grey, affine, folder / f"{name}.nii.gz")
        save(labels, affine, folder / f"{name}_labels.nii.gz")
        save((labels > 0).astype(numpy.uint8), affine,
             folder / ("tissue_before.nii.gz" if name == "preop" else "tissue_now.nii.gz"))
    for source, copy in (("preop.nii.gz", "preop_t2.nii.gz"), ("intraop.nii.gz", "ultrasound.nii.gz"),
                         ("preop_labels.nii.gz", "vessels.nii.gz")):
        (folder / copy).write_bytes((folder / source).read_bytes())


def write_points(folder):
    unit, triangles = sphere()
    surface = CENTRE_LPS + unit * MOVING_AXES
    front = triangles[(unit[triangles].mean(axis=1)[:, 1] < 0.1)]
    back = triangles[(unit[triangles].mean(axis=1)[:, 1] > 0.3)]
    for name, points, faces in (("mr.ply", surface, triangles), ("ultrasound.ply", carry(surface), triangles),
                                ("pial.ply", surface, triangles), ("patch.ply", carry(surface), front),
                                ("second_patch.ply", carry(surface), back),
                                ("lesion.ply", CENTRE_LPS + 0.3 * unit * MOVING_AXES, triangles)):
        used = numpy.unique(faces)
        write_ply(folder / name, points[used], numpy.searchsorted(used, faces))
    inner = CENTRE_LPS + 0.6 * unit[::5] * MOVING_AXES
    pairs = numpy.hstack([inner, carry(inner)])
    for name in ("landmarks.csv", "pairs.csv"):
        write_table(folder / name, "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z", pairs)
    write_table(folder / "targets.csv", "x,y,z", inner)
    write_elastix(folder / "moving_pts.txt", inner)
    write_elastix(folder / "fixed_pts.txt", carry(inner))
    along = numpy.linspace(-0.7, 0.7, 41)
    vessel = CENTRE_LPS + numpy.stack([along, 0.3 * numpy.sin(3 * along), 0.2 * along], axis=1) * MOVING_AXES
    write_lines(folder / "vessels.vtk", vessel)
    write_table(folder / "ultrasound.csv", "x,y,z,line", numpy.hstack([carry(vessel[5:35]), numpy.zeros((30, 1))]))


def write_folder(folder):
    folder = pathlib.Path(folder)
    write_images(folder)
    write_points(folder)
    (folder / "navigation.txt").write_text("1 0 0 -2\n0 1 0 1.5\n0 0 1 -1\n0 0 0 1\n")
    (folder / "ultrasound.csv").write_text((folder / "ultrasound.csv").read_text().replace(",0.0000\n", ",1\n"))
    sweep = Sweep(1)
    sweep.save(folder / "sweep.mha")
    sweep.save(folder / "uncalibrated.mha", calibrated=False)
    (folder / "plus.xml").write_text(plus_configuration(sweep))
    for organ in ("brainshift", "liver"):
        data = folder / "data" / organ
        data.mkdir(parents=True)
        for name in ("preop.nii.gz", "preop_labels.nii.gz", "intraop.nii.gz", "intraop_labels.nii.gz", "landmarks.csv"):
            (data / name).symlink_to(folder / name)
        (data / "intraop_surface.ply").symlink_to(folder / "patch.ply")
