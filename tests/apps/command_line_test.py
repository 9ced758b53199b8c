"""Help, dry runs, parameter files, interrupts, and the small verbs."""

import json
import os
import re
import signal
import subprocess
import unittest

import nibabel
import numpy

from phantom import CENTRE_LPS, MOVING_AFFINE, PROGRAM, PhantomTest, lps_of_voxels, run, save


class CommandLine(PhantomTest):
    def test_help_of_each_verb_names_units(self):
        for verb in ("register", "mesh", "warp", "evaluate", "info", "bench"):
            result = run(verb, "--help")
            self.assertEqual(result.returncode, 0)
            self.assertIn("mm", result.stdout, verb)
            self.assertEqual(result.stderr, "")
        text = run("register", "--help").stdout
        for option, unit in (("--edge-length", "mm"), ("--tolerance", "mm"), ("--default-youngs-modulus", "kPa"),
                             ("--data-stiffness", "kPa/mm"), ("--fade", "mm")):
            self.assertRegex(text, re.escape(option) + r"[^-]*\(" + unit + r"\)")

    def test_dry_run_writes_nothing(self):
        before = sorted(self.phantom.folder.iterdir())
        result = self.phantom.register("--dry-run", "--save-parameters", self.phantom.folder / "saved.toml")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("warped.nii.gz", result.stdout)
        self.assertIn("48 x 48 x 48", result.stdout)
        self.assertEqual(sorted(self.phantom.folder.iterdir()), before)

    def test_parameters_saved_and_read_are_the_same(self):
        first, second = self.phantom.folder / "first.toml", self.phantom.folder / "second.toml"
        result = self.phantom.register("--edge-length", 7.5, "--label-edge-length", "2=6", "--rounds", 2, "--no-align",
                                       "--device", "cpu", "--save-parameters", first)
        self.assertEqual(result.returncode, 0, result.stderr)
        result = run("register", "--config", first, "--save-parameters", second)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(first.read_text(), second.read_text())
        self.assertIn("edge-length = 7.5\n", first.read_text())
        report = json.loads((self.phantom.output / "report.json").read_text())
        self.assertEqual(report["parameters"]["rounds"], 2)
        self.assertEqual(report["parameters"]["label-edge-length"], ["2=6"])
        self.assertIs(report["parameters"]["no-align"], True)

    def test_command_line_wins_over_config(self):
        path = self.phantom.folder / "config.toml"
        path.write_text("edge-length = 7\nrounds = 5\n")
        result = self.phantom.register("--config", path, "--edge-length", 9, "--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("edges of 9 mm", result.stdout)
        self.assertIn("5 rounds", result.stdout)

    def test_one_thread_gives_the_same_files_as_many(self):
        outputs = {}
        for threads in (1, 0):
            output = self.phantom.folder / f"out{threads}"
            result = self.phantom.register("--edge-length", 6, "--rounds", 3, "--device", "cpu", "--threads", threads,
                                           output=output)
            self.assertEqual(result.returncode, 0, result.stderr)
            device = json.loads((output / "report.json").read_text())["device"]
            self.assertEqual(", 1 threads" in device, threads == 1 or os.cpu_count() == 1, device)
            outputs[threads] = [(output / name).read_bytes() for name in
                                ("mesh.vtu", "warped.nii.gz", "warped_labels.nii.gz",
                                 "displacement_fixed_to_moving.nii.gz", "displacement_moving_to_fixed.nii.gz")]
        self.assertEqual(outputs[1], outputs[0])

    def test_file_names_need_not_be_utf8(self):
        path = os.fsencode(self.phantom.folder) + b"/pr\xe9op.nii.gz"
        os.rename(self.phantom.moving, path)
        result = self.phantom.register("--edge-length", 8, "--rounds", 1, moving=os.fsdecode(path))
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((self.phantom.output / "report.json").read_text())
        self.assertTrue(report["inputs"]["moving"]["path"].endswith("op.nii.gz"))

    def test_interrupt_leaves_nothing(self):
        process = subprocess.Popen(
            [PROGRAM, "register", "--moving-labels", self.phantom.moving_labels, "--fixed-labels",
             self.phantom.fixed_labels, "--output", self.phantom.output, "--edge-length", "1.5"],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while process.poll() is None and not self.phantom.output.is_dir():
            pass
        process.send_signal(signal.SIGINT)
        _, message = process.communicate(timeout=100)
        self.assertEqual(process.returncode, 130, message)
        self.assertEqual(message.count("\n"), 1, message)
        self.assertFalse(self.phantom.output.exists())

    def test_labels_on_another_grid_are_resampled_on_request(self):
        affine = MOVING_AFFINE.copy()
        affine[:3, 3] += [0.4, 0.3, 0]
        path = save(self.phantom.moving_labels_array, affine, self.phantom.folder / "shifted.nii.gz")
        result = self.phantom.register("--resample-labels", "--dry-run", moving_labels=path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("warped.nii.gz", result.stdout)

    def test_headers_that_differ_in_a_late_digit_are_one_grid(self):
        affine = MOVING_AFFINE.copy()
        affine[:3, 3] += 2e-6
        path = save(self.phantom.moving_labels_array, affine, self.phantom.folder / "late.nii.gz")
        result = self.phantom.register("--dry-run", moving_labels=path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("warped.nii.gz", result.stdout)


class SmallVerbs(PhantomTest):
    def test_mesh_writes_a_mesh_and_its_quality(self):
        mesh, report = self.phantom.folder / "organ.vtu", self.phantom.folder / "organ.json"
        result = run("mesh", self.phantom.moving_labels, "-o", mesh, "--edge-length", 5, "--json", report)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(result.stderr, "")
        self.assertIn("tetrahedra", result.stdout)
        values = json.loads(report.read_text())
        voxels = numpy.count_nonzero(self.phantom.moving_labels_array)
        self.assertAlmostEqual(sum(values["quality"]["label_volume_mm3"].values()) / voxels, 1, delta=0.05)
        self.assertIn(f"{values['tetrahedra']} tetrahedra", run("info", mesh).stdout)

    def test_mesh_refines_in_parallel_when_asked(self):
        mesh = self.phantom.folder / "parallel.vtu"
        result = run("mesh", self.phantom.moving_labels, "-o", mesh, "--edge-length", 5, "--refinement", "parallel")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("tetrahedra", run("info", mesh).stdout)
        self.assert_refused(run("mesh", self.phantom.moving_labels, "-o", mesh, "--refinement", "fast"), 2, "parallel")

    def test_mesh_refuses_a_name_that_is_no_vtu(self):
        self.assert_refused(run("mesh", self.phantom.moving_labels, "-o", self.phantom.folder / "a.vtk"), 2, ".vtu")

    def test_single_files_need_a_folder(self):
        nowhere = self.phantom.folder / "nowhere"
        for arguments in (("mesh", self.phantom.moving_labels, "-o", nowhere / "a.vtu"),
                          ("warp", self.phantom.moving, "-o", nowhere / "a.nii.gz", "--record", "record.h5"),
                          ("evaluate", "--labels", self.phantom.moving_labels, "--reference-labels",
                           self.phantom.moving_labels, "--json", nowhere / "a.json")):
            self.assert_refused(run(*arguments), 3, str(nowhere))

    def test_info_prints_geometry_and_labels(self):
        result = run("info", "--labels", self.phantom.moving_labels)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("48 x 48 x 48", result.stdout)
        self.assertIn("uint8", result.stdout)
        for label in (1, 2):
            count = numpy.count_nonzero(self.phantom.moving_labels_array == label)
            self.assertRegex(result.stdout, rf"\n  {label} +{count} ")

    def test_info_of_an_unknown_kind(self):
        path = self.phantom.folder / "a.docx"
        path.write_text("")
        result = run("info", path)
        self.assertEqual(result.returncode, 2)
        self.assertEqual(result.stderr.count("\n"), 1)

    def test_warp_and_evaluate_with_a_field(self):
        """A constant field moves points with it, and pulls images against it."""
        vector = numpy.array([3.0, 0.0, -2.0])  # LPS mm
        field = numpy.broadcast_to(vector.astype(numpy.float32), (48, 48, 48, 1, 3))
        image = nibabel.Nifti1Image(field, MOVING_AFFINE)
        image.header.set_intent(1007)
        path = self.phantom.folder / "field.nii.gz"
        nibabel.save(image, str(path))

        points, moved = self.phantom.folder / "points.csv", self.phantom.folder / "moved.csv"
        points.write_text("x,y,z\n" + ",".join(map(str, CENTRE_LPS)) + "\n")
        self.assertEqual(run("warp", points, "-o", moved, "--displacement", path).returncode, 0)
        numpy.testing.assert_allclose(numpy.loadtxt(moved, delimiter=",", skiprows=1), CENTRE_LPS + vector, atol=1e-5)

        warped = self.phantom.folder / "warped.nii.gz"
        result = run("warp", self.phantom.moving_labels, "-o", warped, "--displacement", path, "--labels")
        self.assertEqual(result.returncode, 0, result.stderr)
        lps = lps_of_voxels(MOVING_AFFINE)
        def centroid(labels):
            return lps[labels > 0].mean(axis=0)
        array = numpy.asarray(nibabel.load(str(warped)).dataobj)
        numpy.testing.assert_allclose(centroid(array), centroid(self.phantom.moving_labels_array) - vector, atol=1e-6)

        landmarks, scores = self.phantom.folder / "landmarks.csv", self.phantom.folder / "scores.json"
        landmarks.write_text("pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n0,0,10,3,0,9\n0,5,10,3,5,8\n")
        result = run("evaluate", "--landmarks", landmarks, "--displacement", path, "--json", scores, "--labels",
                     self.phantom.moving_labels, "--reference-labels", self.phantom.moving_labels)
        self.assertEqual(result.returncode, 0, result.stderr)
        values = json.loads(scores.read_text())
        self.assertAlmostEqual(values["target_registration_error"]["all"]["after"]["maximum"], 1.0, delta=1e-5)
        self.assertAlmostEqual(values["target_registration_error"]["all"]["after"]["mean"], 0.5, delta=1e-5)
        self.assertAlmostEqual(values["jacobian"]["minimum"], 1.0, delta=1e-5)
        self.assertEqual(values["overlap"]["all"]["dice"], 1.0)

    def test_warp_refuses_without_anything_to_warp_with(self):
        result = run("warp", self.phantom.moving, "-o", self.phantom.folder / "w.nii.gz")
        self.assert_refused(result, 2, "--record")


if __name__ == "__main__":
    unittest.main()
