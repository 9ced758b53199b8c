"""scripts/benchmark on made-up folders of each set's form: the table that comes of them, what tissuewarp cohort says of it,
and scores of results that are known. The real files were never seen."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import numpy

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path[:0] = [str(ROOT / "scripts"), str(ROOT / "workflow")]
from benchmark_sets import Layout, brats_reg, curious, dirlab_copd, learn2reg, muregpro, rules, sparse_liver
from tissuewarp_cohort import fields

SHAPE, MATRIX = (28, 30, 26), numpy.diag([-2.0, -2.0, 2.0, 1.0])  # voxels to LPS mm
SHIFT = numpy.array([2.0, -2.0, 4.0])  # LPS mm: whole voxels
CENTRE = numpy.array([-28.0, -30.0, 26.0])


def ellipsoid(centre, axes=(16, 14, 15)):
    places = fields.places_of(SHAPE, MATRIX)
    radius = numpy.linalg.norm((places - centre) / axes, axis=1).reshape(SHAPE, order="F")
    return radius < 1, radius


def image(path, centre, outside=0):
    inside, radius = ellipsoid(centre)
    path.parent.mkdir(parents=True, exist_ok=True)
    return rules.save(path, numpy.where(inside, 200 + 100 * numpy.cos(4 * radius), outside).astype(numpy.int16), MATRIX)


def mask(path, centre):
    path.parent.mkdir(parents=True, exist_ok=True)
    return rules.save(path, ellipsoid(centre)[0].astype(numpy.uint8), MATRIX)


def points(count=12):
    return CENTRE + numpy.random.default_rng(1).uniform(-8, 8, (count, 3))


def indices(places):
    return (places - MATRIX[:3, 3]) @ numpy.linalg.inv(MATRIX[:3, :3]).T


class Sets(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-benchmark-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.data, self.work, self.result = (self.folder / name for name in ("data", "work", "result"))
        for folder in (self.data, self.work, self.result):
            folder.mkdir()

    def cases(self, benchmark):
        return list(benchmark.cases(self.data, self.work))

    def shifted_result(self, shape=SHAPE, matrix=MATRIX):
        """What a registration would write that moved all by SHIFT."""
        for name, shift in ((rules.MOVING_TO_FIXED, SHIFT), (rules.FIXED_TO_MOVING, -SHIFT)):
            values = numpy.broadcast_to(shift, (*shape, 3)).astype(numpy.float32)
            fields.write_nifti(self.result / name, values, matrix, vectors=True)
        return self.result

    def checked(self, name, count):
        """What tissuewarp cohort says of the table that the script makes."""
        done = subprocess.run([sys.executable, ROOT / "scripts" / "benchmark", name, self.data, "--output", self.folder / "out",
                               "--program", os.environ["TISSUEWARP"], "--dry-run"], capture_output=True, text=True)
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertIn(f"{count} pairs, 0 done", done.stdout)

    def test_curious(self):
        moving = points()
        for number in (1, 12):
            folder = self.data / "NIFTI" / f"Case{number}"
            image(folder / "MRI" / f"Case{number}-FLAIR.nii.gz", CENTRE)
            image(folder / "US" / f"Case{number}-US-before.nii.gz", CENTRE + SHIFT)
            lines = [" ".join(f"{x:.4f}" for x in (*(a * [-1, -1, 1]), *((a + SHIFT) * [-1, -1, 1]))) + ' 1 1 1 "p"' for a in moving]
            (folder / "Landmarks").mkdir()
            (folder / "Landmarks" / f"Case{number}-MRI-beforeUS.tag").write_text(
                "MNI Tag Point File\nVolumes = 2;\n% 0.5 mm\nPoints =\n" + "\n".join(lines) + ";\n")
        cases = self.cases(curious.BENCHMARK)
        self.assertEqual([case.id for case in cases], ["Case1", "Case12"])
        score = curious.score(cases[0], self.shifted_result())
        self.assertAlmostEqual(score["mTRE before, mm"], numpy.linalg.norm(SHIFT), places=3)
        self.assertLess(score["mTRE, mm"], 0.001)
        self.checked("curious", 2)

    def test_dirlab(self):
        width = 40
        folder = self.data / "copd2" / "copd2"
        folder.mkdir(parents=True)
        body = numpy.full((width, width, 102), -1000, "<i2")
        body[4:36, 4:36] = 30
        body[8:16, 10:30, 10:90] = -850
        body[24:32, 10:30, 10:90] = -850
        for breath in ("iBH", "eBH"):
            body.ravel(order="F").tofile(folder / f"copd2_{breath}CT.img")
        matrix = numpy.diag([0.645, 0.645, 2.5, 1.0])
        here = numpy.random.default_rng(2).integers(12, 20, (300, 3))
        there = here + [1, 2, 3]
        numpy.savetxt(folder / "copd2_300_iBH_xyz_r1.txt", here, fmt="%d")
        numpy.savetxt(folder / "copd2_300_eBH_xyz_r1.txt", there, fmt="%d")
        original, dirlab_copd.WIDTH = dirlab_copd.volume, width
        dirlab_copd.volume = lambda path, slices: original(path, slices, width)
        self.addCleanup(setattr, dirlab_copd, "volume", original)
        self.addCleanup(setattr, dirlab_copd, "WIDTH", 512)
        case, = self.cases(dirlab_copd.BENCHMARK)
        numpy.testing.assert_allclose(case.truth["moving"], (here - 1) @ matrix[:3, :3])
        lungs, stated = rules.load(case.columns["labels"])
        numpy.testing.assert_allclose(stated, matrix, atol=1e-6)
        air = body < -500
        air[:4], air[36:], air[:, :4], air[:, 36:] = False, False, False, False
        self.assertGreater(rules.dice(lungs > 0, air), 0.93)
        step = (there - here)[0] @ matrix[:3, :3]
        values = numpy.broadcast_to(step, (width, width, 102, 3)).astype(numpy.float32)
        fields.write_nifti(self.result / rules.MOVING_TO_FIXED, values, matrix, vectors=True)
        score = dirlab_copd.score(case, self.result)
        self.assertAlmostEqual(score["TRE before, mm"], numpy.linalg.norm(step), places=4)
        self.assertLess(score["TRE, mm"], 1e-4)
        with self.assertRaisesRegex(Layout, "not 512 x 512 x 102"):
            original(folder / "copd2_iBHCT.img", 102)

    def learn2reg_folder(self, task, masks=True):
        pair = {role: f"./imagesTr/{task}_0003_000{k}.nii.gz" for k, role in enumerate(("fixed", "moving"))}
        moving = points()
        for role, places, centre in (("fixed", moving + SHIFT, CENTRE + SHIFT), ("moving", moving, CENTRE)):
            name = pathlib.Path(pair[role]).name
            image(self.data / "imagesTr" / name, centre, -900 if masks else 0)
            if masks:
                mask(self.data / "masksTr" / name, centre)
            (self.data / "keypointsTr").mkdir(exist_ok=True)
            numpy.savetxt(self.data / "keypointsTr" / name.replace(".nii.gz", ".csv"), indices(places), delimiter=",")
        (self.data / f"{task}_dataset.json").write_text(json.dumps({"name": task, "registration_val": [pair]}))

    def test_learn2reg(self):
        for name, task in (("learn2reg-lung", "LungCT"), ("learn2reg-nlst", "NLST")):
            self.learn2reg_folder(task)
            case, = self.cases(learn2reg.BENCHMARKS[name])
            score = learn2reg.score(case, self.shifted_result())
            self.assertAlmostEqual(score["TRE before, mm"], numpy.linalg.norm(SHIFT), places=4)
            self.assertLess(score["TRE, mm"], 1e-3)
            self.assertGreater(score["Dice"], 0.999)
            self.assertLess(score["SDlogJ"], 1e-6)
            self.checked(name, 1)

    def test_remind2reg_without_masks(self):
        self.learn2reg_folder("ReMIND2Reg", masks=False)
        case, = self.cases(learn2reg.BENCHMARKS["remind2reg"])
        self.assertNotIn("labels", case.columns)
        self.checked("remind2reg", 1)

    def test_brats_reg(self):
        moving = points()
        for stem, centre, places in (("BraTSReg_007_00_0000", CENTRE, moving),
                                     ("BraTSReg_007_01_0123", CENTRE + SHIFT, moving + SHIFT)):
            for contrast in ("t1", "t1ce", "t2", "flair"):
                image(self.data / "BraTSReg_007" / f"{stem}_{contrast}.nii.gz", centre)
            rows = "\n".join(f"{k},{x:.3f},{y:.3f},{z:.3f}" for k, (x, y, z) in enumerate(places))
            (self.data / "BraTSReg_007" / f"{stem}_landmarks.csv").write_text("Landmark,X,Y,Z\n" + rows + "\n")
        case, = self.cases(brats_reg.BENCHMARK)
        self.assertEqual(len(case.columns["moving"]), 2)
        score = brats_reg.score(case, self.shifted_result())
        self.assertAlmostEqual(score["MEE before, mm"], numpy.linalg.norm(SHIFT), places=2)
        self.assertLess(score["MEE, mm"], 0.01)
        self.assertEqual(score["robustness"], 1)
        self.assertAlmostEqual(score["least det J"], 1, places=5)
        self.checked("brats-reg", 1)
        path = self.data / "BraTSReg_007" / "BraTSReg_007_00_0000_landmarks.csv"
        path.write_text(path.read_text().replace("-", ""))
        with self.assertRaisesRegex(Layout, "off their image"):
            self.cases(brats_reg.BENCHMARK)

    def test_muregpro(self):
        for role, centre in (("mr", CENTRE), ("us", CENTRE + SHIFT)):
            image(self.data / "val" / f"{role}_images" / "case000065.nii.gz", centre)
            channels = [ellipsoid(centre)[0], *(ellipsoid(centre + offset, (4, 4, 4))[0] for offset in
                                                ((6, 0, 0), (-6, 0, 0), (0, 6, 0), (0, 0, 6)))]
            path = self.data / "val" / f"{role}_labels" / "case000065.nii.gz"
            path.parent.mkdir()
            rules.save(path, numpy.stack([*channels, numpy.zeros(SHAPE)], -1).astype(numpy.float32), MATRIX)
        case, = self.cases(muregpro.BENCHMARK)
        self.assertEqual(case.id, "val_case000065")
        score = muregpro.score(case, self.shifted_result())
        self.assertGreater(score["DSC"], 0.999)
        self.assertLess(score["TRE, mm"], 0.01)
        self.assertEqual(score["HD95, mm"], 0)
        self.assertAlmostEqual(score["TRE before, mm"], numpy.linalg.norm(SHIFT), places=2)
        self.assertAlmostEqual(muregpro.total([score])["score"], 1, places=3)
        self.checked("muregpro", 1)

    def test_sparse_liver(self):
        (self.data / "sets").mkdir()
        numpy.savetxt(self.data / "sets" / "Set001.xyz", points(200), fmt="%.3f")
        with self.assertRaisesRegex(Layout, "holds no liver.stl"):
            self.cases(sparse_liver.BENCHMARK)
        (self.data / "liver.ply").write_text("ply\n")
        case, = self.cases(sparse_liver.BENCHMARK)
        self.assertEqual(case.id, "Set001")
        self.assertEqual(set(case.columns), {"moving_surface", "fixed_surface"})

    def test_a_wrong_folder_is_named(self):
        for name in ("curious", "learn2reg-lung", "dirlab-copd", "muregpro"):
            done = subprocess.run([sys.executable, ROOT / "scripts" / "benchmark", name, self.data, "--output",
                                   self.folder / "out"], capture_output=True, text=True)
            self.assertEqual(done.returncode, 2, done.stderr)
            self.assertIn(str(self.data), done.stderr)


class Rules(unittest.TestCase):
    def test_det_j_of_a_stretch(self):
        with tempfile.TemporaryDirectory() as name:
            places = fields.places_of(SHAPE, MATRIX)
            stretch = numpy.array([[0.1, 0.05, 0], [0, -0.2, 0], [0, 0, 0.3]])
            path = pathlib.Path(name) / "field.nii.gz"
            fields.write_nifti(path, (places @ stretch.T).reshape(*SHAPE, 3, order="F").astype(numpy.float32), MATRIX, vectors=True)
            determinants = rules.determinants(fields.Field(str(path)))
            numpy.testing.assert_allclose(determinants, 1.1 * 0.8 * 1.3, rtol=1e-4)

    def test_robust_measures_keep_the_best(self):
        self.assertAlmostEqual(muregpro.best([0.9, 0.8, 0.1], True), 0.85)
        self.assertEqual(muregpro.best([1.0, 2.0, 9.0], False), 1.5)


if __name__ == "__main__":
    unittest.main()
