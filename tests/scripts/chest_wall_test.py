"""A lung between two walls of bone, whose motion is known."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import unittest

import numpy

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "scripts"
sys.path.insert(0, str(SCRIPTS))
loader = importlib.machinery.SourceFileLoader("chest_wall", str(SCRIPTS / "chest_wall"))
script = importlib.util.module_from_spec(importlib.util.spec_from_loader(loader.name, loader))
loader.exec_module(script)

AFFINE = numpy.diag([2.0, 2.0, 2.5, 1.0])
SIZE = (40, 30, 24)


def slab(first, last):
    mask = numpy.zeros(SIZE, bool)
    mask[first:last] = True
    return mask


class ChestWall(unittest.TestCase):
    def test_what_slides_and_what_is_pressed(self):
        """The lung moves by 6 mm along the walls and 3 mm across them, bone by 1 mm."""
        lung, hard = slab(10, 30), slab(5, 8) | slab(32, 34)
        field = numpy.zeros((*SIZE, 3))
        field[lung] = 3, 0, 6
        field[hard] = 0, 1, 0
        bone, wall, jump = script.motions(field, AFFINE, lung, hard, AFFINE)
        numpy.testing.assert_allclose(bone, 1, atol=1e-6)
        numpy.testing.assert_allclose(wall, 1, atol=1e-6)
        self.assertEqual(len(wall), 4 * SIZE[1] * SIZE[2])  # two layers within 8 mm of either side, and two of the other
        numpy.testing.assert_allclose(jump, 37**0.5, atol=0.1)

    def test_bone_is_in_the_body_and_no_speck(self):
        voxels = numpy.full((40, 40, 40), -1000)
        voxels[5:35, 5:35, 5:35] = 40
        voxels[10:20, 10:20, 10:14] = 900
        voxels[30, 30, 30] = 900
        voxels[38:40, :, :] = 900  # a table
        found = script.bone(voxels)
        self.assertEqual(found.sum(), 10 * 10 * 4)


if __name__ == "__main__":
    unittest.main()
