"""Synthetic breaths: the map has an inverse where masks are drawn with it, and a seed is one breath."""

import pathlib
import sys
import unittest

import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "scripts"))
from study import breaths, fields

LOW, HIGH = numpy.array([-130.0, -90.0, -130.0]), numpy.array([130.0, 90.0, 130.0])


def points(count, seed=0):
    return numpy.random.default_rng(seed).uniform(LOW, HIGH, (count, 3))


class Breaths(unittest.TestCase):
    def test_the_inverse_takes_points_back(self):
        few = points(500)
        for seed in (1, 2, 101, 102):
            move = breaths.drawn_map(LOW, HIGH, numpy.random.default_rng(seed))
            moved = move(few)
            back = breaths.inverse_on_grid(move, moved.min(axis=0), moved.max(axis=0), few)
            self.assertLess(numpy.linalg.norm(back(moved) - few, axis=1).max(), 1.0, seed)

    def test_the_map_does_not_fold(self):
        few, step = points(2000), 0.01
        for seed in range(1, 9):
            move = breaths.drawn_map(LOW, HIGH, numpy.random.default_rng(seed))
            columns = [(move(few + step * axis) - move(few)) / step for axis in numpy.eye(3)]
            self.assertGreater(numpy.linalg.det(numpy.stack(columns, axis=-1)).min(), 0.05, seed)

    def test_a_seed_is_one_breath(self):
        few = points(50)
        first, again, other = [breaths.drawn_map(LOW, HIGH, numpy.random.default_rng(seed))(few) for seed in (3, 3, 4)]
        numpy.testing.assert_array_equal(first, again)
        self.assertGreater(numpy.linalg.norm(first - other, axis=1).mean(), 5.0)

    def test_the_diaphragm_rises_and_the_apex_hardly(self):
        lifts = []
        for seed in range(20):
            move = breaths.drawn_map(LOW, HIGH, numpy.random.default_rng(seed))
            base, apex = [points(200) * [1, 1, 0] + [0, 0, z] for z in (LOW[2], HIGH[2])]
            lifts.append((move(base) - base)[:, 2].mean() - (move(apex) - apex)[:, 2].mean())
        self.assertGreater(min(lifts), 0)
        self.assertLess(max(lifts), 90)

    def test_a_body_is_a_lung_and_its_mirror_image(self):
        affine = numpy.diag([2.0, 2.0, 2.0, 1.0])
        lung = numpy.zeros((40, 40, 40), bool)
        lung[5:35, 8:32, 6:34] = True
        body = breaths.Body(lung, affine, numpy.full(lung.shape, -800), numpy.random.default_rng(5))
        few = points(4000, 3) * 0.6
        inside = body.inside(few)
        self.assertGreater(inside.sum(), 100)
        numpy.testing.assert_array_equal(inside, body.inside(few * [-1, 1, 1]))


if __name__ == "__main__":
    unittest.main()
