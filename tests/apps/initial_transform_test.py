"""A start that something other than the headers tells, and masks over what is matched."""

import json
import struct
import unittest

import h5py
import nibabel
import numpy

from image_test import landmarks_of, textured_phantom
from phantom import CENTRE_LPS, FIXED_AFFINE, PhantomTest, SHIFT_LPS, lps_of_voxels, save

INPUT = 2
FAR = numpy.array([120.0, -80.0, 40.0])  # mm, of the fixed image's frame from the one that it was made in


class InitialTransform(PhantomTest):
    """The fixed image lies 150 mm off, beyond every search of an image; files tell by how much."""

    def setUp(self):
        super().setUp()
        textured = textured_phantom()
        self.addCleanup(textured.temporary.cleanup)
        affine = FIXED_AFFINE.copy()
        affine[:3, 3] += FAR * [-1, -1, 1]
        fixed = nibabel.load(textured.fixed).get_fdata().astype(numpy.float32)
        self.affine = affine
        self.phantom.fixed = save(fixed, affine, self.phantom.folder / "far.nii.gz")
        self.phantom.moving = textured.moving
        landmarks = numpy.loadtxt(landmarks_of(self.phantom), delimiter=",", skiprows=1) + [0, 0, 0, *FAR]
        self.landmarks = self.phantom.folder / "far.csv"
        numpy.savetxt(self.landmarks, landmarks, fmt="%.4f", delimiter=",", comments="",
                      header="pre_x,pre_y,pre_z,intra_x,intra_y,intra_z")

    def file(self, name, content):
        path = self.phantom.folder / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    def register(self, path, *more):
        return self.phantom.register("--initial-transform", path, "--no-error-estimate", "--edge-length", 5,
                                     "--landmarks", self.landmarks, *more, fixed_labels=None)

    def dry_start(self, path):
        """How far the organ starts from the fixed image, from the note."""
        result = self.register(path, "--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)
        return float(result.stdout.split("starts the organ's middle ")[1].split(" mm")[0]), result.stdout

    def affine_text(self, parameters, kind="AffineTransform_double_3_3", centre=(5, 6, 7)):
        return ("#Insight Transform File V1.0\n#Transform 0\nTransform: " + kind + "\nParameters: " +
                " ".join(str(p) for p in parameters) + "\nFixedParameters: " + " ".join(str(c) for c in centre) + "\n")

    def test_a_field_that_was_turned_says_so(self):
        header = ("NRRD0004\ntype: float\ndimension: 4\nspace: RAS\nsizes: 3 101 101 101\nkinds: vector domain domain domain\n"
                  "space directions: none (4,0,0) (0,4,0) (0,0,4)\nspace origin: (-200,-200,-200)\n"
                  "encoding: raw\nendian: little\n\n")
        vectors = numpy.tile((-FAR * [-1, -1, 1]).astype("<f4"), 101 ** 3)
        _, output = self.dry_start(self.file("start.nrrd", header.encode() + vectors.tobytes()))
        self.assertIn("start.nrrd': vectors were turned to LPS", output)

    def test_it_is_where_the_search_of_an_image_begins(self):
        path = self.file("start.tfm", self.affine_text([1, 0, 0, 0, 1, 0, 0, 0, 1, *-FAR]))
        result = self.register(path)
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((self.phantom.output / "report.json").read_text())
        self.assertLess(report["target_registration_error"]["all"]["after"]["mean"], 0.5)
        numpy.testing.assert_allclose(numpy.array(report["initial_transform"]["matrix"])[:3, 3], FAR, atol=1e-6)
        self.assertNotEqual(self.phantom.register("--no-error-estimate", fixed_labels=None).returncode, 0)

    def test_every_format_says_the_same(self):
        shift = " ".join(str(v) for v in -FAR)
        matrix = numpy.eye(4)
        matrix[:3, 3] = -FAR
        with h5py.File(self.phantom.folder / "c.h5", "w") as h5:
            text = h5py.string_dtype()
            for n, (kind, parameters) in enumerate([("CompositeTransform_double_3_3", None),
                                                    ("TranslationTransform_double_3_3", -FAR - [1, 0, 0]),
                                                    ("Euler3DTransform_double_3_3", [0, 0, 0, 1, 0, 0])]):
                group = h5.create_group(f"TransformGroup/{n}")
                group.create_dataset("TransformType", data=[kind], dtype=text)
                if parameters is not None:
                    group["TransformParameters"] = numpy.array(parameters, float)
                    group["TransformFixedParameters"] = numpy.zeros(3)
        name = b"AffineTransform_double_3_3\0"
        matlab = (struct.pack("<5i", 0, 12, 1, 0, len(name)) + name +
                  numpy.array([1, 0, 0, 0, 1, 0, 0, 0, 1, *-FAR]).tobytes() + struct.pack("<5i", 0, 3, 1, 0, 6) +
                  b"fixed\0" + numpy.zeros(3).tobytes())
        field = numpy.tile(-FAR.astype(numpy.float32), (48, 48, 48, 1, 1)).reshape(48, 48, 48, 1, 3)
        image = nibabel.Nifti1Image(field, self.affine)
        image.header.set_intent(1007)
        image.header.set_xyzt_units("mm")
        nibabel.save(image, str(self.phantom.folder / "field.nii.gz"))
        rows = "\n".join(" ".join(str(v) for v in row) for row in matrix)
        for path in (self.file("v.txt", self.affine_text([0, 0, 0, *-FAR], "VersorRigid3DTransform_double_3_3")),
                     self.file("t.txt", self.affine_text(-FAR, "TranslationTransform_double_3_3")),
                     self.file("m.txt", rows), self.file("a.mat", matlab), self.phantom.folder / "c.h5",
                     self.phantom.folder / "field.nii.gz"):
            start, text = self.dry_start(path)
            self.assertLess(start, 10, path)
            self.assertNotIn("wrong way", text)

    def test_forms_of_hdf5_that_are_not_read_are_not_called_damaged(self):
        def written(name, libver, parts):
            with h5py.File(self.phantom.folder / name, "w", libver=libver) as h5:
                for n in range(parts):
                    group = h5.create_group(f"TransformGroup/{n}")
                    kind = "AffineTransform_double_3_3" if n else "CompositeTransform_double_3_3"
                    group.create_dataset("TransformType", data=[kind], dtype=h5py.string_dtype())
                    if n:
                        group["TransformParameters"] = numpy.array([1, 0, 0, 0, 1, 0, 0, 0, 1, *(-FAR / (parts - 1))])
                        group["TransformFixedParameters"] = numpy.zeros(3)
            return self.phantom.folder / name

        self.assertLess(self.dry_start(written("many.h5", "earliest", 12))[0], 10)
        result = self.register(written("latest.h5", "latest", 3), "--dry-run")
        self.assert_refused(result, 3, "latest.h5", "in a form of HDF5 that is not read here", ".tfm")

    def test_the_other_direction_is_said(self):
        start, text = self.dry_start(self.file("t.txt", self.affine_text(FAR, "TranslationTransform_double_3_3")))
        self.assertGreater(start, 200)
        self.assertIn("may map the wrong way", text)
        self.assertIn("from fixed points to moving ones", text)

    def test_what_is_not_rigid_is_said(self):
        path = self.file("s.txt", self.affine_text([1.1, 0, 0, 0, 1, 0, 0, 0, 1, *-FAR]))
        self.assertIn("is not rigid", self.dry_start(path)[1])

    def test_without_alignment_it_is_the_placement(self):
        centre = CENTRE_LPS + SHIFT_LPS + FAR
        turn = self.affine_text([0, 0, 0.1, *-FAR], "Euler3DTransform_double_3_3", centre)
        result = self.register(self.file("e.txt", turn), "--no-align")
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((self.phantom.output / "report.json").read_text())
        numpy.testing.assert_allclose(report["alignment"]["matrix"], report["initial_transform"]["matrix"], atol=1e-9)
        c, s = numpy.cos(0.1), numpy.sin(0.1)  # of the inverse
        numpy.testing.assert_allclose(numpy.array(report["alignment"]["matrix"])[:3, :3],
                                      [[c, s, 0], [-s, c, 0], [0, 0, 1]], atol=1e-9)

    def test_what_is_no_such_transform_is_refused(self):
        for name, content, words in (
                ("words.txt", "hello world", ("words.txt", "'hello'")),
                ("short.txt", "1 2 3", ("short.txt", "four rows")),
                ("mirror.txt", "-1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1", ("mirrors",)),
                ("b.tfm", self.affine_text([1], "BSplineTransform_double_3_3"), ("BSplineTransform", "not read")),
                ("p.tfm", self.affine_text([1, 2]), ("2 parameters", "takes 12"))):
            self.assert_refused(self.register(self.file(name, content)), INPUT, *words)


class Masks(PhantomTest):
    """What they do to a registration is tested in tests/registration/image_update_test.cpp."""

    def setUp(self):
        super().setUp()
        textured = textured_phantom()
        self.addCleanup(textured.temporary.cleanup)
        self.phantom.moving, self.phantom.fixed = textured.moving, textured.fixed
        bad = numpy.linalg.norm(lps_of_voxels(FIXED_AFFINE) - (CENTRE_LPS + SHIFT_LPS + [5, 0, 0]), axis=-1) < 7
        self.mask = save((~bad).astype(numpy.uint8), FIXED_AFFINE, self.phantom.folder / "mask.nii.gz")

    def test_less_is_matched_and_the_share_is_said(self):
        matched = []
        for more in ((), ("--fixed-mask", self.mask)):
            result = self.phantom.register("--edge-length", 4, "--no-error-estimate", *more, fixed_labels=None)
            self.assertEqual(result.returncode, 0, result.stderr)
            report = json.loads((self.phantom.output / "report.json").read_text())
            matched.append(report["image"]["matched"])
        self.assertLess(matched[1], 0.9 * matched[0])
        self.assertIn("mask.nii.gz' excludes 1.29 % of the image", " ".join(report["notes"]))

    def test_masks_that_say_nothing_are_refused(self):
        zero = save(numpy.zeros((48, 48, 48), numpy.uint8), FIXED_AFFINE, self.phantom.folder / "zero.nii.gz")
        self.assert_refused(self.phantom.register("--fixed-mask", zero, fixed_labels=None), INPUT, "zero.nii.gz",
                            "nonzero means")
        self.assert_refused(self.phantom.register("--fixed-mask", self.mask), INPUT, "--match-image")


if __name__ == "__main__":
    unittest.main()
