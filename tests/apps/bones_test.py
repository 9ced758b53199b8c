"""Bones about an organ that each moved on its own: random spines by the command line.

TISSUEWARP_BONES_SEEDS=FIRST-LAST draws others than the two of every test."""

import json
import os
import pathlib
import re
import tempfile
import unittest

import nibabel
import numpy

from phantom import lps_of_voxels, run, save

FIRST, LAST = map(int, os.environ.get("TISSUEWARP_BONES_SEEDS", "1-2").split("-"))
AFFINE = numpy.diag([-1.0, -1.0, 1.0, 1.0])
AFFINE[:3, 3] = [60, 36, -64]
SHAPE = (120, 72, 96)
ORGAN, BONES = 1, (3, 4, 5)


def rotation(degrees, axis):
    x, y, z = axis / numpy.linalg.norm(axis)
    cross = numpy.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = numpy.radians(degrees)
    return numpy.eye(3) + numpy.sin(angle) * cross + (1 - numpy.cos(angle)) * cross @ cross


class Spine:
    """Three bones in a row below an organ that moves up or down as a whole."""

    def __init__(self, seed):
        draw = numpy.random.default_rng(seed)
        self.organ_axes = draw.uniform([34, 20, 15], [44, 26, 19])
        self.organ_shift = numpy.array([0, 0, draw.uniform(0, 3)])
        self.bones = []
        for n, label in enumerate(BONES):
            centre = numpy.array([34.0 * (n - 1), 0, -40]) + draw.uniform(-1.5, 1.5, 3)
            motion = numpy.eye(4)
            motion[:3, :3] = rotation(draw.uniform(-7, 7), draw.normal(size=3))
            shift = draw.uniform([-2, -4, -4], [2, 4, 2]) * (0 if draw.random() < 0.25 else 1)
            motion[:3, 3] = centre - motion[:3, :3] @ centre + shift
            if not shift.any():
                motion = numpy.eye(4)
            self.bones.append((label, centre, draw.uniform([10, 13, 10], [13, 17, 14]), motion))
        while self.overlap():
            self.bones = [(label, centre, 0.95 * half, motion) for label, centre, half, motion in self.bones]

    def is_bone(self, points, centre, half):
        """A body and processes behind it, which tell how it is turned."""
        at = (points - centre) / half
        body = (at ** 2).sum(axis=-1) < 1
        processes = (abs(at[..., 0]) < 0.9) & (at[..., 1] > 0.4) & (at[..., 1] < 1.3) & (abs(at[..., 2]) < 0.3)
        return body | processes

    def parts(self, moved):
        """Masks of the organ and of each bone."""
        places = lps_of_voxels(AFFINE, SHAPE)
        shift = self.organ_shift if moved else 0
        masks = {ORGAN: numpy.linalg.norm((places - shift) / self.organ_axes, axis=-1) < 1}
        for label, centre, half, motion in self.bones:
            back = numpy.linalg.inv(motion if moved else numpy.eye(4))
            masks[label] = self.is_bone(places @ back[:3, :3].T + back[:3, 3], centre, half)
        return masks

    def overlap(self):
        return any((sum(mask.astype(int) for mask in self.parts(moved).values()) > 1).any() for moved in (False, True))

    def labels(self, moved):
        return sum(mask.astype(numpy.uint8) * numpy.uint8(label) for label, mask in self.parts(moved).items())


def dice(a, b):
    return 2 * (a & b).sum() / (a.sum() + b.sum())


class Bones(unittest.TestCase):
    def folder(self):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-test-")
        self.addCleanup(temporary.cleanup)
        return pathlib.Path(temporary.name)

    def registered(self, seed):
        spine, folder = Spine(seed), self.folder()
        moving, fixed = spine.labels(False), spine.labels(True)
        result = run("register", "--no-align", "--rigid-neighbour", ",".join(map(str, BONES)), "--edge-length", 7,
                     "--moving-labels", save(moving, AFFINE, folder / "moving.nii.gz"),
                     "--fixed-labels", save(fixed, AFFINE, folder / "fixed.nii.gz"), "--output", folder / "out")
        self.assertEqual(result.returncode, 0, result.stderr)
        warped = numpy.asarray(nibabel.load(str(folder / "out" / "warped_labels.nii.gz")).dataobj)
        page = (folder / "out" / "report.html").read_text(encoding="utf-8")
        largest = float(re.search(r"Largest displacement in the organ</div>\s*<div class=\"value\">([\d.]+)", page)[1])
        self.assertLess(largest, numpy.linalg.norm(spine.organ_shift) + 1)  # not of a bone
        return spine, moving, fixed, warped, json.loads((folder / "out" / "report.json").read_text())

    def test_each_goes_where_the_labels_show_it(self):
        for seed in range(FIRST, LAST + 1):
            with self.subTest(seed=seed):
                spine, moving, fixed, warped, report = self.registered(seed)
                self.assertLess(report["contact"]["deepest_mm"], 0.3)
                self.assertEqual(report["jacobian"]["field"]["folded"], 0)
                found = {body["label"]: numpy.array(body["matrix"]) for body in report.get("rigid_neighbours", [])}
                for label, centre, half, motion in spine.bones:
                    ends = centre + half * numpy.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
                    went = ends @ motion[:3, :3].T + motion[:3, 3]
                    moved = numpy.linalg.norm(went - ends, axis=1).mean()
                    placed = found.get(label, numpy.eye(4))
                    off = numpy.linalg.norm(ends @ placed[:3, :3].T + placed[:3, 3] - went, axis=1).mean()
                    print(f"seed {seed} bone {label}: moved {moved:.2f} mm, {'followed' if label in found else 'left'}, "
                          f"{off:.2f} mm off; Dice {dice(moving == label, fixed == label):.3f} -> "
                          f"{dice(warped == label, fixed == label):.3f}")
                    self.assertLess(off, 1.0 if label in found else 1.5)
                    self.assertGreater(dice(warped == label, fixed == label), 0.88)

    def test_labels_may_show_bones_alone(self):
        spine, folder = Spine(7), self.folder()
        bones = spine.labels(True)
        bones[bones == ORGAN] = 0
        places = numpy.random.default_rng(1).normal(size=(40, 3))
        places *= 0.7 * spine.organ_axes / numpy.linalg.norm(places, axis=1)[:, None]
        numpy.savetxt(folder / "pairs.csv", numpy.hstack([places, places + spine.organ_shift]), delimiter=",", comments="",
                      header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")
        result = run("register", "--no-align", "--rigid-neighbour", ",".join(map(str, BONES)), "--edge-length", 8,
                     "--moving-labels", save(spine.labels(False), AFFINE, folder / "moving.nii.gz"),
                     "--fixed-labels", save(bones, AFFINE, folder / "fixed.nii.gz"),
                     "--fixed-points", folder / "pairs.csv", "--output", folder / "out")
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((folder / "out" / "report.json").read_text())
        self.assertEqual([body["label"] for body in report["rigid_neighbours"]], list(BONES))
        self.assertEqual(report["points"]["outliers"], 0)
        self.assertNotIn("after", report.get("overlap", {}))


if __name__ == "__main__":
    unittest.main()
