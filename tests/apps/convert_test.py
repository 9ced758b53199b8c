"""Transforms and maps for other programs: written by `register` and `convert`, read by ITK itself, nibabel and json."""

import json
import os
import pathlib
import re
import subprocess
import unittest
import xml.etree.ElementTree

import nibabel
import numpy

from phantom import CENTRE_LPS, FIXED_AXES, MOVING_AFFINE, MOVING_AXES, SHIFT_LPS, Phantom, PhantomTest, run

ITK = os.environ["TISSUEWARP_ITK_POINTS"]
INPUT = 2
MICROMETRE = 1e-3
OF_FIELDS = 0.01  # mm
ROUNDED = 2 * MICROMETRE  # fields hold steps of 1/512 mm: their vectors are up to 1.7 µm off


def through_itk(path, points):
    """Where ITK takes points (N x 3, LPS mm) with this file."""
    text = "\n".join(" ".join(f"{x:.17g}" for x in point) for point in points)
    result = subprocess.run([ITK, str(path)], input=text, capture_output=True, text=True, timeout=60)
    assert result.returncode == 0, result.stderr
    return numpy.array([[float(x) for x in line.split()] for line in result.stdout.splitlines()])


def parts_of(path):
    return subprocess.run([ITK, str(path), "--types"], capture_output=True, text=True, timeout=60).stdout.split()


def places(axes, centre):
    """Points within an ellipsoid, at no voxel's centre."""
    unit = numpy.random.default_rng(5).normal(size=(50, 3))
    unit *= (numpy.linspace(0.1, 0.9, 50) / numpy.linalg.norm(unit, axis=1))[:, None]
    return centre + unit * axes


def table(path):
    return numpy.genfromtxt(path, delimiter=",", names=True)


def columns(values, prefix):
    return numpy.stack([values[prefix + axis] for axis in "xyz"], axis=-1)


class Registered(unittest.TestCase):
    """One registration that the classes below look at."""

    @classmethod
    def setUpClass(cls):
        cls.phantom = phantom = Phantom()
        cls.addClassCleanup(phantom.temporary.cleanup)
        cls.moving_points = places(MOVING_AXES, CENTRE_LPS)
        cls.fixed_points = places(FIXED_AXES, CENTRE_LPS + SHIFT_LPS)
        landmarks, points = phantom.folder / "landmarks.csv", phantom.folder / "points.csv"
        numpy.savetxt(landmarks, numpy.hstack([cls.moving_points, cls.moving_points + SHIFT_LPS]), delimiter=",",
                      header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z", comments="", fmt="%.6f")
        numpy.savetxt(points, cls.moving_points, delimiter=",", header="x,y,z", comments="", fmt="%.6f")
        result = phantom.register("--edge-length", 4, "--landmarks", landmarks, "--points", points, "--write", "all")
        assert result.returncode == 0, result.stderr
        cls.output = phantom.output
        cls.carried = columns(table(cls.output / "warped_points.csv"), "")

    def file(self, name):
        return self.phantom.folder / name

    def convert(self, source, target, *more):
        result = run("convert", source, target, *more)
        self.assertEqual(result.returncode, 0, result.stderr)
        return target

    def assert_close(self, points, expected, tolerance):
        self.assertLess(numpy.linalg.norm(points - expected, axis=1).max(), tolerance)


class Transform(Registered):
    def test_it_is_one_composite_of_a_rigid_part_and_a_field(self):
        for name in ("transform.h5", "inverse_transform.h5"):
            self.assertEqual(parts_of(self.output / name),
                             ["CompositeTransform", "AffineTransform", "DisplacementFieldTransform"])

    def test_itk_maps_points_as_the_written_fields_do(self):
        for name, field, points in (
                ("transform.h5", "displacement_fixed_to_moving.nii.gz", self.fixed_points),
                ("inverse_transform.h5", "displacement_moving_to_fixed.nii.gz", self.moving_points)):
            mapped = through_itk(self.output / name, points)
            self.assert_close(mapped, through_itk(self.output / field, points), 2 * ROUNDED)
            self.assertGreater(numpy.linalg.norm(mapped - points, axis=1).min(), 1)

    def test_a_landmark_goes_there_and_back_through_itk(self):
        for name, points, expected in (("transform.h5", self.carried, self.moving_points),
                                       ("inverse_transform.h5", self.moving_points, self.carried)):
            distance = numpy.linalg.norm(through_itk(self.output / name, points) - expected, axis=1)
            self.assertLess(numpy.percentile(distance, 95), OF_FIELDS)
            self.assertLess(distance.max(), OF_FIELDS + ROUNDED)  # ITK interpolates between voxels, here across kinks

    def test_the_wrong_field_moves_points_twice_as_far_from_their_place(self):
        wrong = through_itk(self.output / "displacement_moving_to_fixed.nii.gz", self.carried)
        before = numpy.linalg.norm(self.carried - self.moving_points, axis=1)
        after = numpy.linalg.norm(wrong - self.moving_points, axis=1)
        numpy.testing.assert_allclose(after / before, 2, atol=0.2)

    def test_beyond_the_field_only_the_rigid_part_is_left(self):
        report = json.loads((self.output / "report.json").read_text())
        placement = numpy.array(report["alignment"]["matrix"])
        far = numpy.array([[500.0, -300, 200]])
        expected = numpy.linalg.solve(placement, [*far[0], 1])[:3]
        self.assert_close(through_itk(self.output / "transform.h5", far), [expected], MICROMETRE)

    def test_it_starts_another_registration_where_this_one_ended(self):
        result = self.phantom.register("--initial-transform", self.output / "transform.h5", "--dry-run",
                                       output=self.file("again"))
        self.assertEqual(result.returncode, 0, result.stderr)
        start = float(re.search(r"starts the organ's middle ([\d.]+) mm", result.stdout).group(1))
        self.assertLess(start, 0.5)
        self.assertNotIn("wrong way", result.stdout)


class Convert(Registered):
    def test_landmarks_go_through_every_file_of_a_field(self):
        expected = through_itk(self.output / "transform.h5", self.fixed_points)
        at = self.output / "transform.h5"
        for name in ("a.nii.gz", "b.nrrd", "c.h5", "d.mha", "e.nii", "f.h5"):
            at = self.convert(at, self.file(name))
            self.assert_close(through_itk(at, self.fixed_points), expected, 5 * MICROMETRE)

    def test_inverting_undoes_the_map(self):
        inverse = self.convert(self.output / "displacement_moving_to_fixed.nii.gz", self.file("inverse.h5"), "--from",
                               "modeling", "--reference", self.phantom.fixed)
        there = through_itk(self.output / "displacement_moving_to_fixed.nii.gz", through_itk(inverse, self.fixed_points))
        self.assert_close(there, self.fixed_points, OF_FIELDS)
        self.assert_close(through_itk(inverse, self.fixed_points),
                          through_itk(self.output / "transform.h5", self.fixed_points), 0.05)
        back = self.convert(inverse, self.file("back.nii.gz"), "--to", "modeling", "--reference", self.phantom.moving)
        self.assert_close(through_itk(back, self.moving_points),
                          through_itk(self.output / "displacement_moving_to_fixed.nii.gz", self.moving_points),
                          OF_FIELDS)

    def test_nrrd_says_its_direction_and_needs_no_inverse(self):
        typed = self.convert(self.output / "displacement_moving_to_fixed.nii.gz", self.file("typed.nrrd"), "--from",
                             "modeling")
        self.assertIn(b"\ndisplacement field type:=modeling\n", typed.read_bytes()[:2000])
        self.assert_close(through_itk(typed, self.moving_points),
                          through_itk(self.output / "displacement_moving_to_fixed.nii.gz", self.moving_points),
                          2 * MICROMETRE)
        plain = self.convert(self.output / "transform.h5", self.file("plain.nrrd"))
        self.assertIn(b"\ndisplacement field type:=resampling\n", plain.read_bytes()[:2000])
        turned = self.convert(typed, self.file("turned.nii.gz"), "--reference", self.phantom.fixed)
        self.assert_close(through_itk(turned, self.fixed_points),
                          through_itk(self.output / "transform.h5", self.fixed_points), 0.05)
        result = self.phantom.register("--initial-transform", typed, "--dry-run", output=self.file("none"))
        self.assertEqual(result.returncode, INPUT)
        self.assertIn("displacement field type:=modeling", result.stderr)
        result = run("convert", typed, self.file("no.h5"), "--from", "resampling")
        self.assertEqual(result.returncode, INPUT)
        self.assertIn("contradicts", result.stderr)

    def test_warp_refuses_a_field_that_says_the_other_direction(self):
        typed = self.convert(self.output / "displacement_moving_to_fixed.nii.gz", self.file("forward.nrrd"), "--from",
                             "modeling")
        points = run("warp", self.file("points.csv"), "-o", self.file("carried.csv"), "--displacement", typed)
        self.assertEqual(points.returncode, 0, points.stderr)
        self.assert_close(columns(table(self.file("carried.csv")), ""), self.carried, 0.05)
        image = run("warp", self.phantom.moving, "-o", self.file("no.nii.gz"), "--displacement", typed)
        self.assertEqual(image.returncode, INPUT)
        self.assertIn("displacement field type:=modeling", image.stderr)
        self.assertFalse(self.file("no.nii.gz").exists())

    def test_the_wrong_field_is_not_taken_silently(self):
        result = run("convert", self.output / "displacement_moving_to_fixed.nii.gz", self.file("wrong.h5"))
        self.assertEqual(result.returncode, INPUT)
        self.assertIn("--from modeling", result.stderr)
        result = run("convert", self.output / "displacement_moving_to_fixed.nii.gz", self.file("wrong.h5"), "--from",
                     "modeling")
        self.assertEqual(result.returncode, INPUT)
        self.assertIn("give the fixed image as --reference", result.stderr)
        self.assertFalse(self.file("wrong.h5").exists())

    def test_a_field_that_is_not_linear_is_not_made_so(self):
        for name in ("no.tfm", "no.txt"):
            result = run("convert", self.output / "transform.h5", self.file(name))
            self.assertEqual(result.returncode, INPUT)
            self.assertIn("mm from any linear transform", result.stderr)
            self.assertFalse(self.file(name).exists())


class Maps(Registered):
    def field(self, name):
        return numpy.squeeze(nibabel.load(self.output / name).get_fdata())

    def test_magnitude_is_that_of_the_field(self):
        image = nibabel.load(self.output / "displacement_magnitude.nii.gz")
        field = nibabel.load(self.output / "displacement_fixed_to_moving.nii.gz")
        numpy.testing.assert_allclose(image.affine, field.affine, atol=1e-6)
        numpy.testing.assert_allclose(image.get_fdata(), numpy.linalg.norm(numpy.squeeze(field.get_fdata()), axis=-1),
                                      atol=2 * ROUNDED)

    def test_jacobian_is_the_change_of_volume(self):
        image = nibabel.load(self.output / "jacobian.nii.gz")
        numpy.testing.assert_allclose(image.affine, MOVING_AFFINE, atol=1e-6)
        field = self.field("displacement_moving_to_fixed.nii.gz")
        # Voxels of 1 mm whose first two axes run along L and P, as LPS has them.
        gradient = numpy.stack([numpy.stack(numpy.gradient(field[..., c]), axis=-1) for c in range(3)], axis=-2)
        expected = numpy.linalg.det(gradient + numpy.eye(3))
        inner = (slice(1, -1),) * 3
        numpy.testing.assert_allclose(image.get_fdata()[inner], expected[inner], atol=0.005)

    def test_the_organ_carries_its_errors(self):
        text = (self.output / "organ.vtp").read_bytes()
        header, data = text.split(b"<AppendedData encoding=\"raw\">\n_")
        tree = xml.etree.ElementTree.fromstring(header + b"</VTKFile>")
        piece = tree.find("PolyData/Piece")

        def array(path, kind, width):
            element = piece.find(path)
            at = int(element.get("offset"))
            size = int(numpy.frombuffer(data, "<u8", 1, at)[0])
            return numpy.frombuffer(data, kind, size // numpy.dtype(kind).itemsize, at + 8).reshape(-1, width)

        nodes = array("Points/DataArray", "<f8", 3)
        self.assertEqual(len(nodes), int(piece.get("NumberOfPoints")))
        self.assertLess(abs(numpy.linalg.norm((nodes - CENTRE_LPS - SHIFT_LPS) / FIXED_AXES, axis=1) - 1).max(), 0.15)
        values = {name: array(f"PointData/DataArray[@Name='{name}']", "<f4", 1)[:, 0]
                  for name in ("deviation_mm", "interval_95_mm", "trust", "displacement_mm")}
        self.assertEqual(piece.find("PointData").get("Scalars"), "deviation_mm")
        self.assertGreater(values["deviation_mm"].min(), 0)
        self.assertTrue((values["interval_95_mm"] > values["deviation_mm"]).all())
        self.assertLessEqual(set(values["trust"]), {1, 2, 3})
        back = through_itk(self.output / "transform.h5", nodes)
        numpy.testing.assert_allclose(values["displacement_mm"], numpy.linalg.norm(nodes - back, axis=1), atol=0.15)
        self.assertEqual(tree.find("PolyData/FieldData/Array").get("Name"), "SPACE")
        self.assertEqual(run("info", self.output / "organ.vtp").returncode, 0)

    def test_markups_hold_the_carried_points_and_their_errors(self):
        for name, prefix, start in (("warped_landmarks", "warped_", "mm from its place; estimated error"),
                                    ("warped_points", "", "estimated error")):
            values = table(self.output / f"{name}.csv")
            file = json.loads((self.output / f"{name}.mrk.json").read_text())
            self.assertIn("markups-schema-v1.0.3.json#", file["@schema"])
            (markups,) = file["markups"]
            self.assertEqual((markups["type"], markups["coordinateSystem"], markups["coordinateUnits"]),
                             ("Fiducial", "LPS", "mm"))
            points = markups["controlPoints"]
            numpy.testing.assert_allclose([p["position"] for p in points], columns(values, prefix), atol=MICROMETRE)
            for point, deviation in zip(points, values["deviation_mm"]):
                self.assertIn(start, point["description"])
                self.assertIn(f"estimated error {deviation:.2f} mm (1 sigma)", point["description"])
                self.assertEqual(point["positionStatus"], "defined")
            back = self.file(f"{name}_back.csv")
            result = run("warp", self.output / f"{name}.mrk.json", "-o", back, "--displacement",
                         self.output / "displacement_fixed_to_moving.nii.gz")
            self.assertEqual(result.returncode, 0, result.stderr)
            self.assert_close(columns(table(back), ""), self.moving_points, 0.05)

    def test_the_report_names_every_file_and_so_does_the_manual(self):
        report = json.loads((self.output / "report.json").read_text())
        self.assertEqual(sorted(report["outputs"]), sorted(path.name for path in self.output.iterdir()))
        page = (pathlib.Path(__file__).parents[2] / "docs" / "manual" / "register-outputs.md").read_text()
        for name in report["outputs"]:
            self.assertIn(f"`{name}`", page)
        for word in ("displacement_magnitude", "jacobian", "organ", "markups", "inverse_transform", "dicom", "all"):
            self.assertIn(f"`{word}`", page)
            self.assertIn(word, run("register", "--help-all").stdout)


class Bids(PhantomTest):
    QUICK = ["--edge-length", 8, "--rounds", 1, "--device", "cpu"]

    def setUp(self):
        super().setUp()
        self.moving = self.phantom.folder / "sub-01_ses-preop_T1w.nii.gz"
        self.phantom.moving.rename(self.moving)
        self.root = self.phantom.output

    def register(self, *more):
        return self.phantom.register(*self.QUICK, "--bids", *more, moving=self.moving)

    def test_results_have_the_names_and_sidecars_of_a_derivative(self):
        for _ in range(2):  # the second run takes the place of the first
            result = self.register("sub-01", "--write", "inverse_transform")
            self.assertEqual(result.returncode, 0, result.stderr)
        description = json.loads((self.root / "dataset_description.json").read_text())
        self.assertEqual(description["DatasetType"], "derivative")
        self.assertEqual(description["GeneratedBy"][0]["Name"], "tissuewarp")
        folder = self.root / "sub-01" / "anat"
        for name, space in (("space-intraop_desc-warped_T1w.nii.gz", "intraop"),
                            ("space-intraop_dseg.nii.gz", "intraop"),
                            ("from-preop_to-intraop_mode-image_xfm.h5", "intraop"),
                            ("from-intraop_to-preop_mode-image_xfm.h5", "preop"),
                            ("from-preop_to-intraop_mode-image_desc-field_xfm.nii.gz", "intraop"),
                            ("from-preop_to-intraop_mode-points_desc-field_xfm.nii.gz", "preop")):
            path = folder / f"sub-01_{name}"
            self.assertTrue(path.is_file(), name)
            sidecar = json.loads((folder / (path.name.split(".")[0] + ".json")).read_text())
            self.assertIn(str(self.moving), sidecar["Sources"])
            self.assertEqual(sidecar["Space"], space)
            self.assertEqual(sidecar["GeneratedBy"][0]["Name"], "tissuewarp")
        report = json.loads((folder / "report.json").read_text())
        self.assertEqual(sorted(report["outputs"]), sorted(path.name for path in folder.iterdir()))
        ignored = (self.root / ".bidsignore").read_text().split()
        for path in folder.iterdir():
            self.assertEqual(path.name in ignored, not path.name.startswith("sub-01_"), path.name)
        point = [CENTRE_LPS + SHIFT_LPS]
        mapped = through_itk(folder / "sub-01_from-preop_to-intraop_mode-image_xfm.h5", point)
        self.assertLess(numpy.linalg.norm(mapped - CENTRE_LPS), 1)

    def test_subjects_and_images_without_a_name_of_bids_are_refused(self):
        self.assert_refused(self.register("sub-0_1"), INPUT, "--bids 'sub-0_1'")
        self.moving = self.moving.rename(self.phantom.folder / "preop.nii.gz")
        self.assert_refused(self.register("01"), INPUT, "preop.nii.gz", "T1w")


class Linear(PhantomTest):
    MATRIX = numpy.array([[0.98, -0.17, 0.05, 12.5], [0.18, 0.97, -0.1, -7.25], [-0.03, 0.11, 1.02, 31.125],
                          [0, 0, 0, 1]])
    POINTS = numpy.array([[1.5, 2.5, -3.25], [-40, 25, 60], [100, -80, 3]])

    def setUp(self):
        super().setUp()
        self.folder = self.phantom.folder
        self.matrix = self.folder / "matrix.txt"
        numpy.savetxt(self.matrix, self.MATRIX)
        self.expected = self.POINTS @ self.MATRIX[:3, :3].T + self.MATRIX[:3, 3]

    def convert(self, source, target, *more):
        result = run("convert", source, self.folder / target, *more)
        self.assertEqual(result.returncode, 0, result.stderr)
        return self.folder / target

    def test_a_point_goes_through_every_file_and_back(self):
        at = self.matrix
        for name in ("a.tfm", "b.h5", "c.txt"):
            at = self.convert(at, name)
            numpy.testing.assert_allclose(through_itk(at, self.POINTS), self.expected, atol=1e-9)
        numpy.testing.assert_allclose(numpy.loadtxt(self.convert(at, "d.txt", "--matrix")), self.MATRIX, atol=1e-12)
        inverse = self.convert(at, "e.tfm", "--to", "modeling")
        numpy.testing.assert_allclose(through_itk(inverse, self.expected), self.POINTS, atol=MICROMETRE)

    def test_through_a_field_it_stays_linear(self):
        self.assert_refused(run("convert", self.matrix, self.folder / "a.nii.gz"), INPUT, "matrix.txt", "--reference")
        field = self.convert(self.matrix, "a.nii.gz", "--reference", self.phantom.fixed)
        near = CENTRE_LPS + self.POINTS / 20
        numpy.testing.assert_allclose(through_itk(field, near), near @ self.MATRIX[:3, :3].T + self.MATRIX[:3, 3],
                                      atol=2 * MICROMETRE)
        back = numpy.loadtxt(self.convert(field, "b.txt", "--matrix"))
        numpy.testing.assert_allclose(back, self.MATRIX, atol=2 * MICROMETRE)

    def test_what_cannot_be_converted_is_refused(self):
        grey = self.phantom.moving
        record = self.folder / "record.h5"
        record.write_bytes(b"\x89HDF\r\n\x1a\n" + bytes(2000))
        for source, target, words in (
                (self.matrix, "a.xyz", ("a.xyz", "names no transform", ".nii.gz")),
                (self.matrix, "a.h5", ("--matrix", ".txt")),
                (grey, "a.h5", ("moving.nii.gz", "1 components", "three")),
                (self.folder / "none.tfm", "a.h5", ("none.tfm",))):
            more = ["--matrix"] if words[0] == "--matrix" else []
            result = run("convert", source, self.folder / target, *more)
            self.assertIn(result.returncode, (2, 3))
            for word in words:
                self.assertIn(word, result.stderr)
            self.assertFalse((self.folder / target).exists())
        flat = self.folder / "flat.txt"
        flat.write_text("1 0 0 0 0 1 0 0 0 0 0 0 0 0 0 1")
        self.assert_refused(run("convert", flat, self.folder / "a.tfm", "--to", "modeling"), INPUT, "flat.txt",
                            "singular")

    def test_the_words_of_write_are_checked(self):
        result = self.phantom.register("--write", "organ,heart")
        self.assert_refused(result, INPUT, "--write", "heart")
        self.assert_refused(self.phantom.register("--write", "markups"), INPUT, "--landmarks or --points")
        listed = self.phantom.register("--write", "organ,jacobian", "--dry-run").stdout
        self.assertIn("organ.vtp", listed)
        self.assertIn("jacobian.nii.gz", listed)
        self.assertNotIn("displacement_magnitude", listed)


if __name__ == "__main__":
    unittest.main()
