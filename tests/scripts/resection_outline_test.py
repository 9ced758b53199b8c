"""Distances of masks whose distance is known, and the brain and cyst of one made here."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import unittest

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))  # what it imports
PATH = pathlib.Path(__file__).resolve().parents[2] / "scripts" / "resection_outline"
loader = importlib.machinery.SourceFileLoader("resection_outline", str(PATH))
script = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
loader.exec_module(script)

VOXEL_MM, SIZE = 2, 52
GRID = script.Grid(numpy.diag([-VOXEL_MM, -VOXEL_MM, VOXEL_MM, 1]))


def ball(radius, middle=(0, 0, 0)):
    axis = VOXEL_MM * (numpy.arange(SIZE) - (SIZE - 1) / 2)
    places = numpy.stack(numpy.meshgrid(axis, axis, axis, indexing="ij"), -1)
    return numpy.linalg.norm(places - middle, axis=-1) < radius


class Outline(unittest.TestCase):
    def test_distance_of_balls(self):
        everywhere = numpy.ones((SIZE,) * 3, bool)
        for apart in GRID.apart(ball(28), ball(24), everywhere):
            self.assertAlmostEqual(apart, 4, delta=0.5)
        self.assertLess(max(GRID.apart(ball(28), ball(28), everywhere)), 0.2)

    def test_brain_without_vessels_and_with_a_cyst(self):
        whole, cyst, vessel = ball(32), ball(9, (10, 0, 0)), ball(4, (-25, 0, 0))
        image = 100.0 * whole - 70 * cyst + 200 * vessel
        brain = script.remaining_brain(GRID, image)
        self.assertFalse(brain[cyst & ball(6, (10, 0, 0))].any())
        self.assertFalse((brain & ball(3, (-25, 0, 0))).any())
        self.assertGreater((brain & whole).sum(), 0.9 * (whole & ~cyst).sum())
        found = script.cyst(image, whole)
        self.assertGreater(2 * (found & cyst).sum() / (found.sum() + cyst.sum()), 0.9)

    def test_outline_and_wall(self):
        """The model's hole is too large by 2 mm, its outline right."""
        cavity, hole = ball(12, (14, 0, 0)), ball(14, (14, 0, 0))
        outline, wall, _ = script.scored(GRID, ball(32) & ~cavity, ball(32) & ~hole, hole)
        self.assertLess(max(outline), 0.5)
        for apart in wall:
            self.assertAlmostEqual(apart, 2, delta=0.7)


if __name__ == "__main__":
    unittest.main()
