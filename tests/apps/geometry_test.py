"""Points through every file of a registration whose grids are oblique, flipped and of unequal spacing, drawn at random.
Read by ITK, elastix, pydicom, nibabel and json.

Places are voxel centres where a file has a grid, so that nothing is interpolated: what is left is what the file says."""

import json
import os
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

import nibabel
import numpy
import pydicom
import pydicom.uid

from convert_test import MICROMETRE, OF_FIELDS, ROUNDED, columns, table, through_itk
from deformable_registration import deformation_of
from dicom_out_test import write_series
from phantom import CENTRE_LPS, FIXED_AXES, MOVING_AXES, SHIFT_LPS, ellipsoid, run, save

TO_RAS = numpy.array([-1.0, -1, 1])


def random_grid(random, left_handed):
    """Affine (RAS) and shape of a grid about the phantom: any rotation, spacings between 0.9 and 1.5 mm."""
    axes, _ = numpy.linalg.qr(random.normal(size=(3, 3)))
    if (numpy.linalg.det(axes) < 0) != left_handed:
        axes[:, random.integers(3)] *= -1
    spacing = random.uniform(0.9, 1.5, 3)
    shape = numpy.ceil(random.uniform(46, 52, 3) / spacing).astype(int)
    affine = numpy.eye(4)
    affine[:3, :3] = axes * spacing
    middle = (CENTRE_LPS + SHIFT_LPS / 2) * TO_RAS + random.uniform(-1, 1, 3)
    affine[:3, 3] = middle - affine[:3, :3] @ ((shape - 1) / 2)
    return affine, tuple(int(n) for n in shape)


def centres_within(affine, shape, centre, axes, random, count=60):
    """Voxel centres (LPS) within an ellipsoid, and their indices."""
    index = numpy.stack(numpy.meshgrid(*map(numpy.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3)
    places = (index @ affine[:3, :3].T + affine[:3, 3]) * TO_RAS
    inside = numpy.flatnonzero(numpy.linalg.norm((places - centre) / axes, axis=1) < 0.85)
    chosen = random.choice(inside, count, replace=False)
    return places[chosen], index[chosen]


class Drawn:
    """One registration on grids of a seed. The fixed image is a DICOM series."""

    SEED, LEFT_HANDED = 0, False

    @classmethod
    def setUpClass(cls):
        random = numpy.random.default_rng(cls.SEED)
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-test-")
        cls.addClassCleanup(temporary.cleanup)
        cls.folder = Path(temporary.name)
        cls.output = cls.folder / "out"
        cls.moving_grid, cls.fixed_grid = random_grid(random, cls.LEFT_HANDED), random_grid(random, False)
        (moving, shape), (fixed, fixed_shape) = cls.moving_grid, cls.fixed_grid
        labels, image = ellipsoid(moving, CENTRE_LPS, MOVING_AXES, shape)
        fixed_labels, fixed_image = ellipsoid(fixed, CENTRE_LPS + SHIFT_LPS, FIXED_AXES, fixed_shape)
        save(labels, moving, cls.folder / "labels.nii.gz")
        cls.moving = cls.write_moving(image, moving)
        save(fixed_labels, fixed, cls.folder / "fixed_labels.nii.gz")
        write_series(fixed_image, fixed, cls.folder / "series", pydicom.uid.generate_uid())
        cls.moving_points, cls.moving_index = centres_within(moving, shape, CENTRE_LPS, MOVING_AXES, random)
        cls.fixed_points, cls.fixed_index = centres_within(fixed, fixed_shape, CENTRE_LPS + SHIFT_LPS, FIXED_AXES, random)
        numpy.savetxt(cls.folder / "points.csv", cls.moving_points, delimiter=",", header="x,y,z", comments="",
                      fmt="%.9f")
        cls.result = run("register", "--moving", cls.moving, "--moving-labels",
                         cls.folder / "labels.nii.gz", "--fixed", cls.folder / "series", "--fixed-labels",
                         cls.folder / "fixed_labels.nii.gz", "--points", cls.folder / "points.csv", "--edge-length", 5,
                         "--rounds", 2, "--device", "cpu", "--write", "all", "--output", cls.output)

    @classmethod
    def write_moving(cls, image, affine):
        return save(image, affine, cls.folder / "preop.nii.gz")

    def setUp(self):
        self.assertEqual(self.result.returncode, 0, self.result.stderr)
        self.carried = columns(table(self.output / "warped_points.csv"), "")
        self.back = through_itk(self.output / "transform.h5", self.fixed_points)

    def assert_close(self, points, expected, tolerance):
        self.assertLess(numpy.linalg.norm(points - expected, axis=1).max(), tolerance)

    def stored(self, name, index):
        """Vectors of a field as nibabel reads them: LPS mm."""
        return numpy.squeeze(numpy.asarray(nibabel.load(self.output / name).dataobj))[tuple(index.T)]

    def test_fields_and_transforms_hold_what_the_model_does(self):
        self.assertGreater(numpy.linalg.norm(self.carried - self.moving_points, axis=1).min(), 0.5)
        for name in ("inverse_transform.h5", "displacement_moving_to_fixed.nii.gz"):
            self.assert_close(through_itk(self.output / name, self.moving_points), self.carried, ROUNDED)
        forward = self.stored("displacement_moving_to_fixed.nii.gz", self.moving_index)
        self.assert_close(self.moving_points + forward, self.carried, ROUNDED)
        backward = self.stored("displacement_fixed_to_moving.nii.gz", self.fixed_index)
        self.assert_close(self.fixed_points + backward, self.back, 2 * ROUNDED)
        self.assert_close(through_itk(self.output / "displacement_fixed_to_moving.nii.gz", self.fixed_points), self.back,
                          2 * ROUNDED)

    def test_points_go_there_and_back(self):
        mean = numpy.linalg.norm(through_itk(self.output / "transform.h5", self.carried) - self.moving_points,
                                 axis=1).mean()
        self.assertLess(mean, OF_FIELDS)  # between voxels of 1.5 mm single ones are further off

    def test_converted_files_say_the_same(self):
        self.assertEqual(run("convert", self.output / "transform.h5", self.folder / "a.nrrd").returncode, 0)
        self.assertEqual(run("convert", self.folder / "a.nrrd", self.folder / "b.mha").returncode, 0)
        self.assertEqual(run("convert", self.folder / "b.mha", self.folder / "c.h5").returncode, 0)
        for name in ("a.nrrd", "b.mha", "c.h5"):
            self.assert_close(through_itk(self.folder / name, self.fixed_points), self.back, 2 * ROUNDED)
        typed = self.folder / "points.nrrd"
        run("convert", self.output / "displacement_moving_to_fixed.nii.gz", typed, "--from", "modeling")
        self.assert_close(through_itk(typed, self.moving_points), self.carried, ROUNDED)

    @unittest.skipUnless(shutil.which("transformix"), "elastix is not installed")
    def test_transformix_carries_points_by_the_field(self):
        work = self.folder / "transformix"
        work.mkdir()
        text = "\n".join(" ".join(f"{x:.9f}" for x in point) for point in self.fixed_points)
        (work / "points.txt").write_text(f"point\n{len(self.fixed_points)}\n{text}\n")
        page = (Path(__file__).parents[2] / "docs" / "manual" / "convert.md").read_text()
        parameters = page.split("```elastix\n")[1].split("```")[0]
        field = self.output / "displacement_fixed_to_moving.nii.gz"
        (work / "field.txt").write_text(parameters.replace("out/displacement_fixed_to_moving.nii.gz", str(field)))
        result = subprocess.run(["transformix", "-def", "points.txt", "-tp", "field.txt", "-out", "."], cwd=work,
                                capture_output=True, text=True)
        self.assertEqual(result.returncode, 0, result.stdout)
        lines = (work / "outputpoints.txt").read_text().splitlines()
        mapped = [line.split("OutputPoint = [")[1].split("]")[0].split() for line in lines]
        self.assert_close(numpy.array(mapped, float), self.back, 2 * ROUNDED)

    def test_markups_hold_the_points(self):
        (markups,) = json.loads((self.output / "warped_points.mrk.json").read_text())["markups"]
        self.assertEqual(markups["coordinateSystem"], "LPS")
        self.assert_close(numpy.array([p["position"] for p in markups["controlPoints"]]), self.carried, MICROMETRE)

    def test_dicom_contours_and_maps_lie_on_the_slices_of_the_series(self):
        affine, shape = self.fixed_grid
        to_voxels = numpy.linalg.inv(affine)
        structures = pydicom.dcmread(self.output / "structures.dcm")
        for roi in structures.ROIContourSequence:
            for contour in roi.ContourSequence:
                points = numpy.array(contour.ContourData, float).reshape(-1, 3) * TO_RAS
                k = (points @ to_voxels[:3, :3].T + to_voxels[:3, 3])[:, 2]
                self.assertLess(abs(k - k[0].round()).max(), MICROMETRE)
        frames = pydicom.dcmread(self.output / "uncertainty.dcm").PerFrameFunctionalGroupsSequence
        places = [frame.PlanePositionSequence[0].ImagePositionPatient for frame in frames]
        expected = [(affine @ [0, 0, k, 1])[:3] * TO_RAS for k in range(shape[2])]
        self.assert_close(numpy.array(places, float), expected, MICROMETRE)


class LeftHanded(Drawn, unittest.TestCase):
    """The moving image is a NIfTI file whose axes are a left-handed system."""

    SEED, LEFT_HANDED = 7, True


class Series(Drawn, unittest.TestCase):
    """The moving image is a DICOM series too, which one of deformable registration takes."""

    SEED = 8

    @classmethod
    def write_moving(cls, image, affine):
        write_series(image, affine, cls.folder / "preop", pydicom.uid.generate_uid())
        return cls.folder / "preop"

    def test_the_dicom_registration_maps_points(self):
        object_ = pydicom.dcmread(self.output / "registration.dcm")
        item = object_.DeformableRegistrationSequence[0]
        before, after, grid, vectors, axes = deformation_of(item)
        index = numpy.linalg.solve(axes, (self.fixed_points - numpy.array(grid.ImagePositionPatient, float)).T).T
        self.assertLess(abs(index - index.round()).max(), MICROMETRE)
        at = index.round().astype(int)
        moved = self.fixed_points @ before[:3, :3].T + before[:3, 3] + vectors[at[:, 2], at[:, 1], at[:, 0]]
        self.assert_close(moved @ after[:3, :3].T + after[:3, 3], self.back, ROUNDED)


if __name__ == "__main__":
    unittest.main()
