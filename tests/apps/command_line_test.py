"""Help, dry runs, parameter files, interrupts, and the small verbs."""

import json
import os
import re
import signal
import subprocess
import unittest

import nibabel
import numpy

from phantom import CENTRE_LPS, FIXED_AFFINE, MOVING_AFFINE, PROGRAM, PhantomTest, lps_of_voxels, run, save


class CommandLine(PhantomTest):
    def test_help_of_each_verb_names_units(self):
        for verb in ("register", "mesh", "warp", "evaluate", "info", "bench"):
            result = run(verb, "--help-all")
            self.assertEqual(result.returncode, 0)
            self.assertIn("mm", result.stdout, verb)
            self.assertEqual(result.stderr, "")
        text = run("register", "--help-all").stdout
        for option, unit in (("--edge-length", "mm"), ("--tolerance", "mm"), ("--default-youngs-modulus", "kPa"),
                             ("--data-stiffness", "kPa/mm"), ("--fade", "mm")):
            self.assertRegex(text, re.escape(option) + r"[^-]*\(" + unit + r"\)")

    def test_short_help_shows_what_matters_and_where_the_rest_is(self):
        def options(*arguments):
            return set(re.findall(r"^  (?:-\w,)?(--[a-z-]+)", run(*arguments).stdout, re.MULTILINE)) - {"--help"}

        short, full = options("register", "--help"), options("register", "--help-all")
        self.assertEqual(len(short), 12, short)
        self.assertLess(short, full)
        text = run("register", "-h").stdout
        self.assertIn("tissuewarp register --help-all", text)
        self.assertNotIn("Excludes", text)
        self.assertNotIn("\n\n\n", text)
        self.assertLessEqual(len(text.splitlines()), 50)
        whole = run("register", "--help-all").stdout
        rest = whole.split("\nOptions:\n")[1].split("\n\n")[0]
        self.assertEqual(re.findall(r"--[a-z-]+", rest), ["--help", "--help-all"], "every option has a purpose")
        self.assertEqual(options("mesh", "--help"), options("mesh", "--help-all"))

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

    def test_images_on_the_command_line_replace_those_of_the_config(self):
        path = self.phantom.folder / "config.toml"
        path.write_text('moving = ["no-such-file.nii.gz", "nor-this.nii.gz"]\nfixed = ["a.nii.gz", "b.nii.gz"]\n')
        result = self.phantom.register("--config", path, "--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)

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

    def test_an_image_that_is_only_a_grid_does_not_coarsen_the_boundary(self):
        coarse = FIXED_AFFINE @ numpy.diag([2.0, 2.0, 2.0, 1.0])
        image = save(self.phantom.fixed_array[::2, ::2, ::2], coarse, self.phantom.folder / "coarse.nii.gz")

        def last_round(**files):
            output = self.phantom.folder / ("of_" + "_".join(files))
            result = self.phantom.register("--resample-labels", "--edge-length", "5", output=output, **files)
            self.assertEqual(result.returncode, 0, result.stderr)
            return json.loads((output / "report.json").read_text())["rounds"][-1]

        with_image, without = last_round(fixed=image), last_round(fixed=None)
        for name in ("matched", "mean_residual_mm", "force_evaluations"):
            self.assertEqual(with_image[name], without[name], name)

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

    def test_mesh_says_what_it_drops(self):
        labels = self.phantom.moving_labels_array.copy()
        labels[1, 1, 1] = labels[-2, -2, -2] = 1
        path = save(labels, MOVING_AFFINE, self.phantom.folder / "specks.nii.gz")
        result = run("mesh", path, "-o", self.phantom.folder / "organ.vtu", "--edge-length", 8)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("1 pieces\n", result.stdout)
        self.assertRegex(result.stdout, r"note: meshing: 2 disconnected pieces of labels .* were given to")

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

    def test_info_says_nothing_of_a_file_that_it_cannot_read(self):
        path = self.phantom.folder / "damaged.nii.gz"
        path.write_bytes(b"garbage")
        result = run("info", path)
        self.assertEqual(result.stdout, "")
        self.assertRegex(result.stderr, r"^tissuewarp info: cannot read '.*damaged\.nii\.gz'")

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
        for name in ("minimum", "percentile_5", "percentile_95"):
            self.assertAlmostEqual(values["jacobian"][name], 1.0, delta=1e-5)
        self.assertEqual(values["jacobian"]["folded_share"], 0)

    def evaluate_places(self, *more):
        """The phantom carried by 3 mm to the left: landmarks in it, near its rim and outside, and a fixed surface."""
        vector, folder = numpy.array([3.0, 0.0, 0.0]), self.phantom.folder
        for name, sign in (("field", 1), ("inverse", -1)):
            image = nibabel.Nifti1Image(
                numpy.broadcast_to((sign * vector).astype(numpy.float32), (48, 48, 48, 1, 3)), MOVING_AFFINE)
            image.header.set_intent(1007)
            nibabel.save(image, str(folder / f"{name}.nii.gz"))
        rows = [CENTRE_LPS, CENTRE_LPS + [0, 10, 0], CENTRE_LPS + [0, 14, 0]]  # 12, 2 and -2 mm deep
        (folder / "landmarks.csv").write_text("pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n" + "".join(
            ",".join(map(str, [*row, *(row + vector + [0, 0, error])])) + "\n"
            for row, error in zip(rows, (0.5, 1.0, 2.0))))
        angles = numpy.linspace(0, 2 * numpy.pi, 40, endpoint=False)
        circle = numpy.stack([0 * angles, numpy.cos(angles), numpy.sin(angles)], axis=1)
        numpy.savetxt(folder / "surface.csv", CENTRE_LPS + vector + 13.0 * circle, delimiter=",", header="x,y,z",
                      comments="")
        scores = folder / "scores.json"
        result = run("evaluate", "--landmarks", folder / "landmarks.csv", "--displacement", folder / "field.nii.gz",
                     "--json", scores, *more)
        return result, json.loads(scores.read_text()) if scores.exists() else None

    def test_evaluate_by_place(self):
        folder = self.phantom.folder
        result, values = self.evaluate_places(
            "--inverse", folder / "inverse.nii.gz", "--mask", self.phantom.moving_labels, "--moving-labels",
            self.phantom.moving_labels, "--data-surface", folder / "surface.csv", "--held-out", folder / "surface.csv")
        self.assertEqual(result.returncode, 0, result.stderr)
        errors = values["target_registration_error"]
        self.assertEqual([bin["after"]["count"] for bin in errors["by_depth"]], [1, 1, 0, 1, 0])
        self.assertAlmostEqual(errors["by_depth"][0]["after"]["mean"], 2.0, delta=1e-4)
        self.assertAlmostEqual(errors["by_depth"][3]["after"]["mean"], 0.5, delta=1e-4)
        self.assertIsNone(errors["by_depth"][2]["after"]["mean"])
        self.assertRegex(result.stdout, "depth outside the organ +1 ")
        self.assertIn("1 of 3 moving landmarks lie outside the organ", values["notes"][0])
        self.assertRegex(result.stdout, "depth 5–10 mm +0 +– +– +– +–")
        # Distances to the circle of 13 mm: about 13, 3.1 and 2.2 mm.
        self.assertEqual([bin["after"]["count"] for bin in errors["by_distance_to_data"]], [2, 0, 1, 0])
        self.assertEqual(values["inverse_consistency"]["left_the_grid"], 0)
        self.assertLess(values["inverse_consistency"]["error_mm"]["maximum"], 1e-5)
        # The organ's radius is 12 mm there, less a quarter of a voxel (its axes end on voxel centres that are left out).
        self.assertAlmostEqual(values["held_out_surface"]["distance_mm"]["mean"], 1.2, delta=0.15)
        self.assertAlmostEqual(values["held_out_surface"]["mean_signed_mm"], 1.2, delta=0.15)

    def evaluate_curves(self, fixed, *more):
        """A line along y through the middle, in three points, as XML polydata; the field carries it 3 mm to the left."""
        self.evaluate_places()
        folder = self.phantom.folder
        (folder / "scores.json").unlink(missing_ok=True)
        line = CENTRE_LPS + numpy.array([[0, -8, 0], [0, 0, 0], [0, 8, 0]])
        array = '<DataArray type="{}" Name="{}" NumberOfComponents="{}" format="ascii">{}</DataArray>\n'
        (folder / "vessels.vtp").write_text(
            '<VTKFile type="PolyData" version="1.0" byte_order="LittleEndian">\n<PolyData>\n'
            '<Piece NumberOfPoints="3" NumberOfLines="1">\n<Points>\n'
            + array.format("Float64", "Points", 3, " ".join(map(str, line.ravel()))) + "</Points>\n<Lines>\n"
            + array.format("Int64", "connectivity", 1, "0 1 2") + array.format("Int64", "offsets", 1, "3")
            + "</Lines>\n</Piece>\n</PolyData>\n</VTKFile>\n")
        rows = "".join(",".join(map(str, row)) + "\n" for row in fixed)
        (folder / "seen.csv").write_text("x,y,z,line\n" + rows)
        scores = folder / "scores.json"
        result = run("evaluate", "--moving-curves", folder / "vessels.vtp", "--fixed-curves", folder / "seen.csv",
                     "--json", scores, *more)
        return result, json.loads(scores.read_text())["curves"] if scores.exists() else None

    def test_evaluate_curves(self):
        fixed = [[*(CENTRE_LPS + [3, y, 1]), "a"] for y in numpy.arange(-3, 4)]
        result, curves = self.evaluate_curves(fixed, "--displacement", self.phantom.folder / "field.nii.gz")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(curves["to_lines"]["after"]["count"], 7)
        for way, count in (("to_lines", 7), ("from_lines", 7)):
            self.assertEqual(curves[way]["after"]["count"], count)
            for key in ("mean", "median", "percentile_95", "maximum"):
                self.assertAlmostEqual(curves[way]["before"][key], 10 ** 0.5, delta=1e-4)
                self.assertAlmostEqual(curves[way]["after"][key], 1, delta=1e-4)
        self.assertAlmostEqual(curves["shown_mm"]["after"], 6, delta=1e-4)
        self.assertRegex(result.stdout, r"points to lines, before +7 +3\.162")
        self.assertRegex(result.stdout, r"lines to points, after +7 +1\.000")

    def test_evaluate_curves_without_field_and_without_lines(self):
        loose = [[*(CENTRE_LPS + [3, y, 0]), ""] for y in numpy.arange(-3, 4)]
        result, curves = self.evaluate_curves(loose)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertAlmostEqual(curves["to_lines"]["before"]["maximum"], 3, delta=1e-6)
        self.assertNotIn("after", curves["to_lines"])
        self.assertNotIn("from_lines", curves)
        self.assertNotIn("lines to points", result.stdout)

    def test_evaluate_curves_refuses_what_cannot_be(self):
        good = [[*(CENTRE_LPS + [3, y, 0]), "a"] for y in numpy.arange(-3, 4)]
        far = [[*(CENTRE_LPS + [203, y, 0]), "a"] for y in numpy.arange(-3, 4)]
        self.assert_refused(self.evaluate_curves(far)[0], 2, "seen.csv", "vessels.vtp", "RAS")
        self.assert_refused(self.evaluate_curves(good[:3])[0], 2, "seen.csv", "at least 5")
        self.assert_refused(run("evaluate", "--moving-curves", self.phantom.folder / "vessels.vtp"), 2, "--fixed-curves")
        self.assert_refused(run("evaluate", "--json", "a.json"), 2, "--moving-curves")

    def test_evaluate_refuses_data_in_other_frames_and_units(self):
        folder, labels = self.phantom.folder, self.phantom.moving_labels
        _, _ = self.evaluate_places()
        (folder / "scores.json").unlink()
        points = numpy.loadtxt(folder / "surface.csv", delimiter=",", skiprows=1)
        for name, changed in (("metres", points / 1000), ("far", points + 2000)):
            numpy.savetxt(folder / f"{name}.csv", changed, delimiter=",", header="x,y,z", comments="")
        for more, words in (
                (("--moving-labels", labels, "--held-out", folder / "metres.csv"), ("metres.csv", "metres?")),
                (("--moving-labels", labels, "--held-out", folder / "far.csv"), ("LPS",)),
                (("--data-surface", folder / "far.csv"), ("LPS",)),
                (("--data-surface", folder / "surface.csv", "--bin-edges", "5,3"), ("ascending",)),
                (("--held-out", folder / "surface.csv"), ("--moving-labels",)),
                (("--inverse", labels), ("three",)),
                (("--data-points", folder / "none.csv"), ("none.csv",))):
            result, _ = self.evaluate_places(*more)
            self.assertIn(result.returncode, (2, 3), result.stderr)
            self.assertEqual(result.stderr.count("\n"), 1, result.stderr)
            for word in words:
                self.assertIn(word, result.stderr)
        for option, file in (("--moving-labels", labels), ("--data-surface", folder / "surface.csv")):
            result = run("evaluate", "--displacement", folder / "field.nii.gz", option, file)
            self.assert_refused(result, 2, option, "--landmarks")

    def test_warp_refuses_without_anything_to_warp_with(self):
        result = run("warp", self.phantom.moving, "-o", self.phantom.folder / "w.nii.gz")
        self.assert_refused(result, 2, "--record")


if __name__ == "__main__":
    unittest.main()
