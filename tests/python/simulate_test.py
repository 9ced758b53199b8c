"""Scenes as files and as texts give arrays."""

import unittest

import numpy
import tissuewarp

from phantom import ROOT



class Simulate(unittest.TestCase):
    def test_the_cube_sags_from_a_file_and_from_its_text(self):
        path = ROOT / "data/scenes/cube.toml"
        by_file = tissuewarp.simulate(path)
        by_text = tissuewarp.simulate(path.read_text(), folder=path.parent)
        self.assertEqual(len(by_file), len(by_file.times))
        self.assertEqual(by_file.displacement().shape, by_file.mesh.nodes.shape)
        numpy.testing.assert_array_equal(by_file.displacement(0), 0)
        self.assertGreater(numpy.abs(by_file.displacement()).max(), 5)
        numpy.testing.assert_array_equal(by_file.displacement(), by_text.displacement())
        for name, moved in by_file.probes.items():
            self.assertEqual(moved.shape, (len(by_file), 3), name)
        self.assertLess(min(moved[-1, 2] for moved in by_file.probes.values()), -5)

    def test_a_wrong_key_is_named_with_its_line(self):
        text = "\ntitel = 'a'\n" + (ROOT / "data/scenes/cube.toml").read_text()
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "scene', line 2: .*titel"):
            tissuewarp.simulate(text)
        with self.assertRaisesRegex(tissuewarp.IoError, "missing.toml"):
            tissuewarp.simulate("missing.toml")

    def test_false_cancels(self):
        with self.assertRaises(tissuewarp.Cancelled):
            tissuewarp.simulate(ROOT / "data/scenes/cube.toml", progress=lambda stage, fraction: False)


if __name__ == "__main__":
    unittest.main()
