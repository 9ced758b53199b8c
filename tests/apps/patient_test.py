"""prepare and update: register in two halves, with a file between them."""

import json
import pathlib
import unittest

import h5py
import nibabel
import numpy

from phantom import CENTRE_LPS, FIXED_AXES, SHIFT_LPS, Phantom, PhantomTest, run
from points_test import pairs_of, save_points, sphere

INPUT, FILE = 2, 3


def prepared(phantom, *more, name="patient.tw", **replaced):
    """The patient file of the phantom, with edges of 4 mm."""
    files = {"moving": phantom.moving, "moving_labels": phantom.moving_labels, **replaced}
    options = [word for role, path in files.items() if path for word in ("--" + role.replace("_", "-"), path)]
    path = phantom.folder / name
    result = run("prepare", *options, "--edge-length", 4, *more, "--output", path)
    assert result.returncode == 0, result.stderr
    return path


def surface_of(phantom):
    unit = sphere(900)
    return save_points(CENTRE_LPS + SHIFT_LPS + unit[unit[:, 1] > -0.4] * FIXED_AXES, phantom.folder / "seen.csv")


class SameBits(unittest.TestCase):
    """Whatever is seen: fields, records and maps of update are those of register."""

    @classmethod
    def setUpClass(cls):
        cls.phantom = Phantom()
        cls.addClassCleanup(cls.phantom.temporary.cleanup)
        cls.patient = prepared(cls.phantom)

    def assert_same(self, seen, *, patient=None, preoperative=()):
        one, two = self.phantom.folder / "one", self.phantom.folder / "two"
        arguments = [*seen, "--write", "organ,inverse_transform", "--output"]
        once = self.phantom.register(*preoperative, "--edge-length", 4, *arguments, one, fixed=None, fixed_labels=None,
                                     output=None)
        self.assertEqual(once.returncode, 0, once.stderr)
        later = run("update", patient or self.patient, *arguments, two, folder="/")
        self.assertEqual(later.returncode, 0, later.stderr)
        self.assertEqual(sorted(p.name for p in one.iterdir()), sorted(p.name for p in two.iterdir()))
        for path in one.glob("*.nii.gz"):
            a, b = nibabel.load(path), nibabel.load(two / path.name)
            numpy.testing.assert_array_equal(a.affine, b.affine, path.name)
            numpy.testing.assert_array_equal(numpy.asarray(a.dataobj), numpy.asarray(b.dataobj), path.name)
        for name in ("organ.vtp", "mesh.vtu"):
            self.assertEqual((one / name).read_bytes(), (two / name).read_bytes(), name)
        with h5py.File(one / "record.h5") as a, h5py.File(two / "record.h5") as b:
            for name in ("displacement", "placement", "jacobian", "mesh/nodes"):
                numpy.testing.assert_array_equal(a[name][()], b[name][()], name)
        reports = [json.loads((folder / "report.json").read_text()) for folder in (one, two)]
        for key in ("doubts", "rounds", "alignment", "materials", "mesh", "jacobian"):
            self.assertEqual(reports[0][key], reports[1][key], key)
        return reports

    def test_labels(self):
        first, second = self.assert_same(["--fixed", self.phantom.fixed, "--fixed-labels", self.phantom.fixed_labels])
        self.assertGreater(second["overlap"]["after"]["all"]["dice"], 0.9)
        self.assertEqual(second["inputs"]["moving-labels"]["sha256"], first["inputs"]["moving-labels"]["sha256"])
        self.assertEqual(second["parameters"]["edge-length"], 4)

    def test_surface(self):
        self.assert_same(["--fixed-surface", surface_of(self.phantom), "--surface-sd", 0.3])

    def test_image(self):
        self.assert_same(["--fixed", self.phantom.fixed])

    def test_pairs_with_tissue_of_its_own(self):
        table = self.phantom.folder / "materials.toml"
        table.write_text('[label.1]\nname = "rim"\nyoungs_modulus_kpa = 2\npoissons_ratio = 0.4\n'
                         '[label.2]\nname = "core"\nyoungs_modulus_kpa = 9\npoissons_ratio = 0.4\n')
        preoperative = ["--materials", table]
        _, second = self.assert_same(["--fixed-points", pairs_of(self.phantom), "--points-sd", 0.5],
                                     patient=prepared(self.phantom, *preoperative, name="tissues.tw"), preoperative=preoperative)
        self.assertEqual(second["materials"]["2"]["name"], "core")

    def test_lungs_are_stretched_too(self):
        preoperative = ["--tissue", "lung"]
        _, second = self.assert_same(["--fixed-labels", self.phantom.fixed_labels], preoperative=preoperative,
                                     patient=prepared(self.phantom, *preoperative, name="lung.tw"))
        self.assertNotEqual(second["alignment"]["free_stretch"], [[1, 0, 0], [0, 1, 0], [0, 0, 1]])


class Patients(PhantomTest):
    def test_info_tells_where_it_came_from(self):
        result = run("info", prepared(self.phantom))
        self.assertEqual(result.returncode, 0, result.stderr)
        for words in ("prepared patient", "tetrahedra", "images to match  1", "moving-labels", "prepared"):
            self.assertIn(words, result.stdout)

    def test_a_mesh_that_labels_could_use_finer_is_noted(self):
        path = self.phantom.folder / "coarse.tw"
        made = run("prepare", "--moving-labels", self.phantom.moving_labels, "-o", path)
        self.assertEqual(made.returncode, 0, made.stderr)
        result = run("update", path, "--fixed-labels", self.phantom.fixed_labels, "-o", self.phantom.output)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("--for-labels", result.stdout)

    def test_nothing_to_match_an_image_with(self):
        patient = prepared(self.phantom, moving=None)
        self.assert_refused(run("update", patient, "--fixed", self.phantom.fixed, "-o", self.phantom.output), INPUT,
                            "patient.tw", "without an image", "--moving")

    def test_options_of_the_other_half(self):
        refused = [(("update", "x.tw", "--edge-length", 4), "--edge-length", "prepare"),
                   (("update", "x.tw", "--moving", "a.nii"), "--moving", "prepare"),
                   (("prepare", "--fixed", "a.nii"), "--fixed", "update"),
                   (("prepare", "--accuracy", "1mm"), "--accuracy", "register")]
        for arguments, *words in refused:
            with self.subTest(arguments=arguments):
                self.assert_refused(run(*arguments, "-o", self.phantom.output), INPUT, *words)

    def test_a_name_that_is_no_patient(self):
        result = run("prepare", "--moving-labels", self.phantom.moving_labels, "-o", self.phantom.folder / "p.h5")
        self.assert_refused(result, INPUT, "p.h5", ".tw")


class BadPatients(PhantomTest):
    def setUp(self):
        super().setUp()
        self.patient = prepared(self.phantom, moving=None)

    def refused(self, path, code, *words):
        self.assert_refused(run("update", path, "--fixed-labels", self.phantom.fixed_labels, "-o",
                                self.phantom.output), code, pathlib.Path(path).name, *words)

    def changed(self, change):
        """Another program's copy, without the seal."""
        path = self.phantom.folder / "changed.tw"
        with h5py.File(self.patient) as old, h5py.File(path, "w") as new:
            for name in old:
                old.copy(name, new)
            new.attrs.update(old.attrs)
            change(new)
        return path

    def test_truncated(self):
        short = self.phantom.folder / "short.tw"
        short.write_bytes(self.patient.read_bytes()[:-1000])
        self.refused(short, FILE)

    def test_of_another_version(self):
        def later(file):
            file.attrs["format_version"] = 99
        self.refused(self.changed(later), INPUT, "99")

    def test_another_programs_facts(self):
        def other(file):
            del file["patient/facts"]
            file["patient/facts"] = ["{}"]
        self.refused(self.changed(other), INPUT, "facts")

    def test_a_model_alone(self):
        def alone(file):
            del file["patient"]
        self.refused(self.changed(alone), INPUT, "model alone", "tissuewarp prepare")

    def test_missing(self):
        self.refused(self.phantom.folder / "none.tw", FILE)


if __name__ == "__main__":
    unittest.main()
