"""Registration to points of a surface, to pairs of points and to vessels, without fixed labels or image."""

import json
import unittest

import h5py
import nibabel
import numpy

from phantom import (CENTRE_LPS, FIXED_AXES, MOVING_AFFINE, MOVING_AXES, SHIFT_LPS, Phantom, PhantomTest,
                     lps_of_voxels, run)

INPUT = 2
OUTPUTS = ["displacement_fixed_to_moving.nii.gz", "displacement_moving_to_fixed.nii.gz", "mesh.vtu", "preview.png",
           "record.h5", "report.html", "report.json", "transform.h5", "uncertainty.nii.gz", "uncertainty_trust.nii.gz", "warped.nii.gz", "warped_labels.nii.gz"]


def sphere(count):
    """Unit vectors spread evenly."""
    z = 1 - (2 * numpy.arange(count) + 1) / count
    angle = numpy.pi * (3 - numpy.sqrt(5)) * numpy.arange(count)
    return numpy.stack([numpy.sqrt(1 - z * z) * numpy.cos(angle), numpy.sqrt(1 - z * z) * numpy.sin(angle), z], axis=1)


def save_points(points, path, header="x,y,z"):
    numpy.savetxt(path, points, fmt="%.4f", delimiter=",", header=header, comments="")
    return path


def pairs_of(phantom):
    """Where points of the moving organ lie in the fixed one: a CSV of landmarks."""
    unit = numpy.concatenate([radius * sphere(20) for radius in (0.3, 0.6, 0.9)])
    pairs = numpy.hstack([CENTRE_LPS + unit * MOVING_AXES, CENTRE_LPS + SHIFT_LPS + unit * FIXED_AXES])
    return save_points(pairs, phantom.folder / "pairs.csv", "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")


class FromASurface(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = Phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        unit = sphere(900)
        seen = CENTRE_LPS + SHIFT_LPS + unit[unit[:, 1] > -0.4] * FIXED_AXES
        seen += numpy.random.default_rng(1).normal(scale=0.2, size=seen.shape)
        cls.result = phantom.register("--fixed-surface", save_points(seen, phantom.folder / "seen.csv"),
                                      "--surface-sd", 0.3, "--edge-length", 4, fixed=None, fixed_labels=None)
        if cls.result.returncode == 0:
            cls.report = json.loads((phantom.output / "report.json").read_text())

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)

    def test_outputs(self):
        self.assertEqual(sorted(path.name for path in self.phantom.output.iterdir()), OUTPUTS)
        self.assertIn("surface points", self.result.stdout)
        self.assertNotIn("Dice", self.result.stdout)

    def test_report(self):
        self.assertNotIn("overlap", self.report)
        self.assertGreater(self.report["surface"]["inlier_share"], 0.9)
        self.assertLess(self.report["surface"]["residual_mm"], 0.5)
        self.assertEqual(len(self.report["inputs"]["fixed-surface"]["sha256"]), 64)
        self.assertEqual(self.report["parameters"]["surface-sd"], 0.3)

    def test_warped_organ_lies_where_the_points_are(self):
        """On the moving grid as the rigid alignment carries it; the organ is then that of the fixed image."""
        image = nibabel.load(str(self.phantom.output / "warped_labels.nii.gz"))
        ras_to_lps = numpy.diag([-1, -1, 1, 1])
        expected = ras_to_lps @ numpy.array(self.report["alignment"]["matrix"]) @ ras_to_lps @ MOVING_AFFINE
        numpy.testing.assert_allclose(image.affine, expected, atol=1e-3)
        warped = numpy.asarray(image.dataobj) > 0
        lps = lps_of_voxels(image.affine)
        truth = numpy.linalg.norm((lps - CENTRE_LPS - SHIFT_LPS) / FIXED_AXES, axis=-1) < 1
        self.assertGreater(2 * numpy.count_nonzero(warped & truth) / (warped.sum() + truth.sum()), 0.93)
        numpy.testing.assert_allclose(lps[warped].mean(axis=0), CENTRE_LPS + SHIFT_LPS, atol=0.7)

    def test_warp_with_the_record_repeats_the_result(self):
        target = self.phantom.folder / "again.nii.gz"
        again = run("warp", self.phantom.moving, "--record", self.phantom.output / "record.h5", "--reference",
                    self.phantom.output / "warped.nii.gz", "--output", target)
        self.assertEqual(again.returncode, 0, again.stderr)
        a, b = (numpy.asarray(nibabel.load(str(path)).dataobj) for path in (target, self.phantom.output / "warped.nii.gz"))
        numpy.testing.assert_allclose(a, b, atol=1e-3)


class FromPairs(PhantomTest):
    def test_pairs_of_points_carry_the_organ(self):
        pairs = pairs_of(self.phantom)
        result = self.phantom.register("--fixed-points", pairs, "--points-sd", 0.3, "--landmarks", pairs,
                                       "--edge-length", 4, fixed=None, fixed_labels=None)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("60 of 60 fit", result.stdout)
        report = json.loads((self.phantom.output / "report.json").read_text())
        self.assertEqual(report["points"]["outliers"], 0)
        error = report["target_registration_error"]["all"]
        self.assertGreater(error["before"]["mean"], 2.5)
        self.assertLess(error["after"]["mean"], 0.4)

    def test_nothing_to_register_to(self):
        result = self.phantom.register(fixed=None, fixed_labels=None)
        self.assert_refused(result, INPUT, "--fixed-labels", "--fixed-surface", "--fixed-points")

    def test_surface_in_metres(self):
        path = save_points(0.001 * sphere(50) * FIXED_AXES, self.phantom.folder / "metres.csv")
        result = self.phantom.register("--fixed-surface", path, fixed=None, fixed_labels=None)
        self.assert_refused(result, INPUT, "metres.csv", "mm")

    def test_dry_run(self):
        result = self.phantom.register("--fixed-points", pairs_of(self.phantom), "--dry-run", fixed=None,
                                       fixed_labels=None)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("carried along", result.stdout)


def vessels():
    """Lines in the unit ball: a trunk and four bowed branches of it."""
    t = numpy.linspace(0, 1, 15)[:, None]
    ends = [((-0.8, 0, 0), (0, 0.1, 0)), ((0, 0.1, 0), (0.6, 0.4, 0.3)), ((0, 0.1, 0), (0.5, -0.5, 0.1)),
            ((0, 0.1, 0), (0.1, 0.2, -0.8)), ((-0.4, 0, 0.1), (-0.4, -0.4, 0.6))]
    return [numpy.array(a) + t * (numpy.array(b) - a) + 0.1 * numpy.sin(numpy.pi * t) for a, b in ends]


def save_polydata(lines, path):
    """Legacy VTK with LINES."""
    points = numpy.concatenate(lines)
    first = numpy.cumsum([0] + [len(line) for line in lines])
    cells = [" ".join(map(str, [b - a, *range(a, b)])) for a, b in zip(first, first[1:])]
    path.write_text("# vtk DataFile Version 3.0\nSPACE=LPS\nASCII\nDATASET POLYDATA\n"
                    f"POINTS {len(points)} double\n" + "\n".join(" ".join(map(str, p)) for p in points)
                    + f"\nLINES {len(cells)} {len(points) + len(cells)}\n" + "\n".join(cells) + "\n")
    return path


class FromCurves(PhantomTest):
    def setUp(self):
        super().setUp()
        self.moving = save_polydata([CENTRE_LPS + line * MOVING_AXES for line in vessels()],
                                    self.phantom.folder / "vessels.vtk")
        seen = numpy.concatenate([line[:-3] for line in vessels()])
        noise = numpy.random.default_rng(2).normal(scale=0.3, size=seen.shape)
        self.fixed = save_points(CENTRE_LPS + SHIFT_LPS + seen * FIXED_AXES + noise, self.phantom.folder / "seen.csv")

    def register(self, *more):
        return self.phantom.register(*more, "--edge-length", 4, fixed=None, fixed_labels=None)

    def test_vessels_carry_the_organ(self):
        result = self.register("--moving-curves", self.moving, "--fixed-curves", self.fixed, "--curves-sd", 0.3,
                               "--landmarks", pairs_of(self.phantom))
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("points along vessels: ", result.stdout)
        report = json.loads((self.phantom.output / "report.json").read_text())
        self.assertEqual(report["curves"]["points"], 60)
        self.assertGreater(report["curves"]["inlier_share"], 0.9)
        self.assertLess(report["curves"]["residual_mm"], 0.5)
        self.assertEqual(report["parameters"]["curves-sd"], 0.3)
        distances = report["curves"]["to_lines"]
        self.assertEqual(distances["after"]["count"], 60)
        self.assertGreater(distances["before"]["median"], 1)
        self.assertLess(distances["after"]["median"], 0.6)
        self.assertIn("curves to lines (mm)", result.stdout)
        self.assertIn("Points along vessels: ", (self.phantom.output / "report.html").read_text())
        self.assertEqual(len(report["inputs"]["moving-curves"]["sha256"]), 64)
        error = report["target_registration_error"]["all"]
        self.assertGreater(error["before"]["mean"], 2.5)
        self.assertLess(error["after"]["mean"], 1.0)

    def test_curves_that_cannot_be_used(self):
        self.assert_refused(self.register("--moving-curves", self.moving), INPUT, "--fixed-curves")
        self.assert_refused(self.register("--fixed-curves", self.fixed), INPUT, "--moving-curves")
        self.assert_refused(self.register("--moving-curves", self.fixed, "--fixed-curves", self.fixed), INPUT,
                            "seen.csv", "holds no line", "'line'")
        ras = save_points((CENTRE_LPS + vessels()[0] * MOVING_AXES) * [-1, -1, 1] - [300, 0, 0],
                          self.phantom.folder / "elsewhere.csv")
        lines = save_polydata([numpy.loadtxt(ras, delimiter=",", skiprows=1)], self.phantom.folder / "elsewhere.vtk")
        self.assert_refused(self.register("--moving-curves", lines, "--fixed-curves", self.fixed), INPUT,
                            "moving curves", "RAS")


class WithSurroundings(PhantomTest):
    """A slab of bone, label 3, a millimetre below the organ; pairs that say that the organ moved 5 mm towards it."""

    def setUp(self):
        super().setUp()
        labels = self.phantom.moving_labels_array.copy()
        self.bone_top = CENTRE_LPS[2] - 12.5  # between two slices
        labels[lps_of_voxels(MOVING_AFFINE)[..., 2] < self.bone_top] = 3
        image = nibabel.Nifti1Image(labels, MOVING_AFFINE)
        image.header.set_xyzt_units("mm")
        self.labels = self.phantom.folder / "with_bone.nii.gz"
        nibabel.save(image, str(self.labels))
        unit = numpy.concatenate([radius * sphere(20) for radius in (0.3, 0.6, 0.9)])
        moving = CENTRE_LPS + unit * MOVING_AXES
        self.pairs = save_points(numpy.hstack([moving, moving - [0, 0, 5]]), self.phantom.folder / "down.csv",
                                 "pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")

    def register(self, *more):
        return self.phantom.register("--fixed-points", self.pairs, "--no-align", "--edge-length", 4, *more,
                                     moving_labels=self.labels, fixed=None, fixed_labels=None)

    def test_the_organ_does_not_enter_bone(self):
        result = self.register("--rigid-neighbour", 3, "--anchor", "2")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("rigid neighbours: ", result.stdout)
        report = json.loads((self.phantom.output / "report.json").read_text())
        self.assertEqual(report["parameters"]["rigid-neighbour"], ["3"])
        self.assertGreater(report["contact"]["touching"], 0)
        self.assertLess(report["contact"]["deepest_mm"], 0.2)
        self.assertLess(report["anchors"]["largest_mm"], 0.5)
        self.assertNotIn("3", report["materials"])
        with h5py.File(self.phantom.output / "record.h5") as record:
            nodes = record["mesh/nodes"][:] + record["displacement"][:]
            self.assertGreater(nodes[:, 2].min(), self.bone_top - 0.2)
            self.assertEqual(record["contact/touching"][()], report["contact"]["touching"])

    def test_labels_that_cannot_be_surroundings(self):
        for options, words in ((("--rigid-neighbour", "3,7"), ("with_bone.nii.gz", "label 7 is absent", "1, 2, 3")),
                               (("--anchor", 9), ("label 9 is absent",)),
                               (("--anchor", 3, "--rigid-neighbour", 3), ("choose one",)),
                               (("--rigid-neighbour", "bone"), ("--rigid-neighbour 'bone'",)),
                               (("--rigid-neighbour", "1,2,3"), ("nothing is left",))):
            self.assert_refused(self.register(*options, "--dry-run"), INPUT, *words)

    def test_a_material_is_not_asked_of_bone(self):
        table = self.phantom.folder / "materials.toml"
        table.write_text("".join(f"[label.{label}]\nyoungs_modulus_kpa = 3.0\npoissons_ratio = 0.45\n"
                                 for label in (1, 2)))
        result = self.register("--rigid-neighbour", 3, "--materials", table, "--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_refused(self.register("--materials", table, "--dry-run"), INPUT, "3")


if __name__ == "__main__":
    unittest.main()
