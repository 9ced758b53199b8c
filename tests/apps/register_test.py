"""One registration from end to end, its files read by other software."""

import json
import os
import pathlib
import unittest
import unittest.mock

import h5py
import nibabel
import numpy
import scipy.ndimage

from phantom import CENTRE_LPS, FIXED_AFFINE, MOVING_AFFINE, SHIFT_LPS, SIZE, Phantom, run

OUTPUTS = ["displacement_fixed_to_moving.nii.gz", "displacement_moving_to_fixed.nii.gz", "gap.nii.gz", "mesh.vtu", "preview.png",
           "record.h5", "report.html", "report.json", "transform.h5", "uncertainty.nii.gz",
           "uncertainty_trust.nii.gz", "warped.nii.gz",
           "warped_labels.nii.gz", "warped_landmarks.csv", "warped_points.csv"]


def dice(a, b):
    return 2 * numpy.count_nonzero(a & b) / (numpy.count_nonzero(a) + numpy.count_nonzero(b))


def voxel_of(affine, lps):
    return tuple(numpy.rint(numpy.linalg.solve(affine, [-lps[0], -lps[1], lps[2], 1])[:3]).astype(int))


class Register(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = Phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        landmarks, points = phantom.folder / "landmarks.csv", phantom.folder / "points.csv"
        row = ",".join(map(str, [*CENTRE_LPS, *(CENTRE_LPS + SHIFT_LPS)]))
        landmarks.write_text("pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n" + row + "\n")
        points.write_text("x,y,z\n" + ",".join(map(str, CENTRE_LPS)) + "\n")
        names = phantom.folder / "names.ctbl"
        names.write_text("# Color table file\n0 Background 0 0 0 0\n2 right_lobe 128 174 128 255\n")
        cls.result = phantom.register("--edge-length", 4, "--landmarks", landmarks, "--points", points,
                                      "--label-names", names)
        if cls.result.returncode == 0:
            cls.report = json.loads((phantom.output / "report.json").read_text())

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)

    def load(self, name):
        return nibabel.load(str(self.phantom.output / name))

    def test_outputs(self):
        self.assertEqual(sorted(path.name for path in self.phantom.output.iterdir()), OUTPUTS)
        self.assertEqual(sorted(self.report["outputs"]), OUTPUTS)

    def test_quiet_in_a_pipe(self):
        self.assertEqual(self.result.stderr, "")
        self.assertIn("total", self.result.stdout)
        self.assertIn("target error (mm)", self.result.stdout)
        self.assertNotIn("\r", self.result.stdout)

    def test_warped_labels_lie_on_the_fixed_grid_and_match(self):
        image = self.load("warped_labels.nii.gz")
        numpy.testing.assert_allclose(image.affine, FIXED_AFFINE, atol=1e-5)
        warped = numpy.asarray(image.dataobj)
        self.assertGreater(dice(warped > 0, self.phantom.fixed_labels_array > 0), 0.95)
        for label in (1, 2):
            measured = dice(warped == label, self.phantom.fixed_labels_array == label)
            self.assertAlmostEqual(self.report["overlap"]["after"][str(label)]["dice"], measured, delta=1e-6)
        union = dice(warped > 0, self.phantom.fixed_labels_array > 0)
        self.assertAlmostEqual(self.report["overlap"]["after"]["all"]["dice"], union, delta=1e-6)
        self.assertLess(self.report["overlap"]["before"]["all"]["dice"], union)

    def test_warped_image_shows_the_fixed_organ(self):
        warped = numpy.asarray(self.load("warped.nii.gz").dataobj)
        self.assertEqual(warped.dtype, numpy.float32)
        both = (self.phantom.fixed_labels_array > 0) & (warped > 55)
        difference = numpy.abs(warped - self.phantom.fixed_array)[both]
        self.assertLess(numpy.median(difference), 5.0)  # of a range of 80

    def test_fields_point_the_right_way(self):
        for name, affine, point, expected in (
                ("displacement_moving_to_fixed.nii.gz", MOVING_AFFINE, CENTRE_LPS, SHIFT_LPS),
                ("displacement_fixed_to_moving.nii.gz", FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, -SHIFT_LPS)):
            image = self.load(name)
            self.assertEqual(image.header["intent_code"], 1007)
            self.assertEqual(image.shape, (SIZE, SIZE, SIZE, 1, 3))
            numpy.testing.assert_allclose(image.affine, affine, atol=1e-5)
            value = numpy.asarray(image.dataobj)[voxel_of(affine, point)][0]  # LPS mm
            numpy.testing.assert_allclose(value, expected, atol=0.5)

    def test_points_and_landmarks(self):
        point = numpy.loadtxt(self.phantom.output / "warped_points.csv", delimiter=",", skiprows=1)
        numpy.testing.assert_allclose(point[:3], CENTRE_LPS + SHIFT_LPS, atol=0.5)
        error = self.report["target_registration_error"]
        self.assertEqual(error["all"]["before"]["count"], 1)
        self.assertAlmostEqual(error["all"]["before"]["mean"], numpy.linalg.norm(SHIFT_LPS), delta=1e-6)
        measured = numpy.linalg.norm(point[:3] - CENTRE_LPS - SHIFT_LPS)
        self.assertAlmostEqual(error["all"]["after"]["maximum"], measured, delta=1e-5)
        self.assertEqual(error["moved"]["after"]["count"], 1)
        table = numpy.genfromtxt(self.phantom.output / "warped_landmarks.csv", delimiter=",", names=True)
        self.assertAlmostEqual(float(table["after_mm"]), measured, delta=1e-5)

    def test_error_estimate(self):
        estimate = self.report["error_estimate"]
        self.assertGreater(estimate["deviation_mm"], 0)
        self.assertGreaterEqual(estimate["deviation_mm"], max(estimate["data_mm"], estimate["discretisation_mm"]))
        self.assertGreater(estimate["interval_95_mm"], estimate["deviation_mm"])
        table = numpy.genfromtxt(self.phantom.output / "warped_landmarks.csv", delimiter=",", names=True)
        self.assertGreater(float(table["interval_95_mm"]), float(table["deviation_mm"]))
        deviation = nibabel.load(self.phantom.output / "uncertainty.nii.gz")
        trust = numpy.asarray(nibabel.load(self.phantom.output / "uncertainty_trust.nii.gz").dataobj)
        labels = numpy.asarray(nibabel.load(self.phantom.output / "warped_labels.nii.gz").dataobj)
        values = deviation.get_fdata()
        numpy.testing.assert_array_equal(numpy.isnan(values), trust == 0)
        # The table and the volumes speak of the same place.
        warped = numpy.array([-table["warped_x"], -table["warped_y"], table["warped_z"], 1])  # RAS
        voxel = (numpy.linalg.inv(deviation.affine) @ warped)[:3]
        there = scipy.ndimage.map_coordinates(values, voxel[:, None], order=1)[0]
        self.assertAlmostEqual(there, float(table["deviation_mm"]), delta=0.03 * there)
        self.assertEqual(trust[tuple(numpy.round(voxel).astype(int))], float(table["trust"]))
        self.assertGreater((trust[labels > 0] > 0).mean(), 0.9)  # but for voxels cut by the surface
        self.assertLess((trust[labels == 0] > 0).mean(), 0.02)
        self.assertAlmostEqual(numpy.sqrt(numpy.nanmean(values ** 2)), estimate["deviation_mm"],
                               delta=0.2 * estimate["deviation_mm"])

    def test_labels_have_their_names_everywhere(self):
        self.assertEqual(self.report["overlap"]["after"]["2"]["name"], "right lobe")
        self.assertNotIn("name", self.report["overlap"]["after"]["1"])
        self.assertIn("label 2 (right lobe)", self.result.stdout)
        self.assertIn("<td>2 right lobe</td>", (self.phantom.output / "report.html").read_text())
        result = run("info", "--labels", self.phantom.fixed_labels, "--label-names", self.phantom.folder / "names.ctbl")
        self.assertIn("'right lobe'", result.stdout)

    def test_report_holds_every_chapter(self):
        for key in ("schema", "schema_version", "program", "version", "versions", "started", "inputs", "parameters",
                    "materials", "device", "mesh", "alignment", "rounds", "overlap", "jacobian", "doubts", "notes",
                    "outputs", "stages", "total_seconds", "peak_memory_mb", "estimated_error_mm",
                    "target_registration_error"):
            self.assertIn(key, self.report)
        for chapter in ("mesh", "field_in_organ", "field"):
            self.assertGreater(self.report["jacobian"][chapter]["minimum"], 0)
            self.assertEqual(self.report["jacobian"][chapter]["folded"], 0)
        for field in ("moving_to_fixed", "fixed_to_moving"):
            self.assertEqual(self.report["jacobian"]["unfolded"][field]["left"], 0)
        parted = numpy.asarray(self.load("gap.nii.gz").dataobj) == 2
        voxel_ml = abs(numpy.linalg.det(self.load("gap.nii.gz").affine)) / 1000
        self.assertAlmostEqual(self.report["parted_ml"], parted.sum() * voxel_ml, 6)
        self.assertGreater(self.report["held_out"]["seconds"], 0)
        self.assertLess(self.report["held_out"]["seconds"], self.report["total_seconds"])
        for key in ("dice", "hausdorff_95_mm", "mean_surface_distance_mm"):
            self.assertIn(key, self.report["overlap"]["after"]["all"])
        stages = [entry["stage"] for entry in self.report["stages"]]
        for stage in ("read", "meshing", "rest stiffness", "rigid alignment", "correspondence", "equilibrium", "fields", "warp",
                      "score", "write"):
            self.assertIn(stage, stages)
        self.assertGreater(self.report["peak_memory_mb"], 10)

    def test_provenance(self):
        import hashlib
        roles = self.report["inputs"]
        for role in ("moving", "moving-labels", "fixed", "fixed-labels", "landmarks", "points"):
            with open(roles[role]["path"], "rb") as file:
                self.assertEqual(roles[role]["sha256"], hashlib.sha256(file.read()).hexdigest())
        with h5py.File(self.phantom.output / "record.h5") as record:
            self.assertGreater(len(record.keys()), 0)

    @unittest.skipUnless("avx2" in pathlib.Path("/proc/cpuinfo").read_text(), "a processor without AVX2")
    def test_blas_knows_the_processor_unless_told_another(self):
        blas = self.report["versions"]["BLAS"]
        if not blas.startswith("OpenBLAS"):
            self.skipTest(blas)
        self.assertNotIn("Prescott", blas)
        told = self.phantom.folder / "told"
        with unittest.mock.patch.dict(os.environ, OPENBLAS_CORETYPE="Prescott"):
            result = self.phantom.register("--edge-length", 8, output=told)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("Prescott", json.loads((told / "report.json").read_text())["versions"]["BLAS"])

    def test_mesh_carries_displacement_and_jacobian(self):
        text = (self.phantom.output / "mesh.vtu").read_bytes()[:4000].decode("latin-1")
        for name in ("displacement", "total_displacement", "J", "label"):
            self.assertIn(f'Name="{name}"', text)

    def test_warp_with_the_record_repeats_the_result(self):
        again = self.phantom.folder / "again.nii.gz"
        result = run("warp", self.phantom.moving_labels, "-o", again, "--record", self.phantom.output / "record.h5",
                     "--reference", self.phantom.fixed, "--labels")
        self.assertEqual(result.returncode, 0, result.stderr)
        first, second = (numpy.asarray(nibabel.load(str(path)).dataobj)
                         for path in (self.phantom.output / "warped_labels.nii.gz", again))
        self.assertEqual(numpy.count_nonzero(first != second), 0)

    def test_warp_refuses_what_lies_in_metres_or_elsewhere(self):
        record, surface = self.phantom.output / "record.h5", self.phantom.folder / "s.obj"
        for scale, shift, words in ((1, 0, None), (0.001, 0, "in metres?"), (1, 3000, "mm from the model")):
            corners = scale * (CENTRE_LPS + 40 * numpy.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])) + shift
            surface.write_text("".join("v {} {} {}\n".format(*corner) for corner in corners) +
                               "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n")
            points = self.phantom.folder / "p.csv"
            numpy.savetxt(points, corners, delimiter=",", header="x,y,z", comments="")
            for path in (surface, points):
                warped = self.phantom.folder / f"warped{path.suffix}"
                warped.unlink(missing_ok=True)
                result = run("warp", path, "-o", warped, "--record", record)
                self.assertEqual(result.returncode, 2 if words else 0, result.stderr)
                self.assertEqual(warped.exists(), not words)
                if words:
                    self.assertIn(words, result.stderr)
                    self.assertIn(path.name, result.stderr)

    def test_evaluate_repeats_the_scores(self):
        scores = self.phantom.folder / "scores.json"
        result = run("evaluate", "--labels", self.phantom.output / "warped_labels.nii.gz", "--reference-labels",
                     self.phantom.fixed_labels, "--json", scores, "--label-names",
                     self.phantom.folder / "names.ctbl")
        self.assertIn("label 2 (right lobe)", result.stdout)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(json.loads(scores.read_text())["overlap"], self.report["overlap"]["after"])

    def test_info_reads_the_record(self):
        result = run("info", self.phantom.output / "record.h5")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("record of a registration", result.stdout)


if __name__ == "__main__":
    unittest.main()
