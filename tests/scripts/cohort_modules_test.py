"""The parts of tissuewarp cohort that need no program: grids of headers, outliers, order, devices, foretelling, groups."""

import pathlib
import sys
import tempfile
import types
import unittest

import nibabel
import numpy

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "workflow"))
from tissuewarp_cohort import devices, digests, fields, foretell, groups, headers, histogram, job, plan, summary, thumbnail
from tissuewarp_cohort.layout import Layout


class Folder(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory(prefix="tissuewarp-modules-")
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)


class Headers(Folder):
    def oblique(self, degrees):
        a = numpy.radians(degrees)
        turn = numpy.array([[numpy.cos(a), -numpy.sin(a), 0], [numpy.sin(a), numpy.cos(a), 0], [0, 0, -1]])
        affine = numpy.eye(4)
        affine[:3, :3], affine[:3, 3] = turn * [1.5, 2, 2.5], [10, -20, 30]
        return affine

    def saved(self, name, set_form):
        image = nibabel.Nifti1Image(numpy.zeros((5, 6, 7), numpy.int16), None)
        set_form(image)
        nibabel.save(image, self.folder / name)
        return headers.grid_of(str(self.folder / name))

    def test_places_are_nibabels(self):
        affine = self.oblique(30)
        for name, form in (("q.nii", lambda i: i.set_qform(affine, 1)), ("s.nii.gz", lambda i: i.set_sform(affine, 1))):
            grid = self.saved(name, form)
            self.assertEqual(grid.size, (5, 6, 7))
            numpy.testing.assert_allclose(grid.point((4, 3, 2)), nibabel.affines.apply_affine(affine, (4, 3, 2)), atol=1e-4)

    def test_grids_that_differ_by_a_hundredth_of_a_voxel(self):
        near, far = self.oblique(30), self.oblique(30)
        near[0, 3] += 0.0005
        far[0, 3] += 0.02
        here = self.saved("a.nii", lambda i: i.set_sform(self.oblique(30), 1))
        self.assertTrue(headers.same_grid(here, self.saved("b.nii", lambda i: i.set_sform(near, 1))))
        self.assertFalse(headers.same_grid(here, self.saved("c.nii", lambda i: i.set_sform(far, 1))))

    def test_cut_files_and_lost_voxels(self):
        self.saved("a.nii", lambda i: i.set_sform(self.oblique(0), 1))
        whole = (self.folder / "a.nii").read_bytes()
        (self.folder / "a.nii").write_bytes(whole[:-1])
        with self.assertRaisesRegex(headers.Unusable, "ends after 771 of 772 bytes"):
            headers.grid_of(str(self.folder / "a.nii"))
        (self.folder / "b.mhd").write_text("ObjectType = Image\nNDims = 3\nDimSize = 4 4 4\nElementSpacing = 1 2 3\n"
                                           "ElementType = MET_SHORT\nElementDataFile = b.raw\n")
        with self.assertRaisesRegex(headers.Unusable, "'b.raw', which is not there"):
            headers.grid_of(str(self.folder / "b.mhd"))
        (self.folder / "b.raw").write_bytes(bytes(128))
        self.assertEqual(headers.grid_of(str(self.folder / "b.mhd")).spacing(), (1, 2, 3))

    def test_a_header_with_its_voxels_beside_it_is_both(self):
        self.test_cut_files_and_lost_voxels()
        before = digests.digest_of(str(self.folder / "b.mhd"))
        (self.folder / "b.raw").write_bytes(bytes(127) + b"1")
        self.assertNotEqual(digests.digest_of(str(self.folder / "b.mhd")), before)


class Sums(unittest.TestCase):
    def row(self, name, state="done", doubts=0, worst=1.0, **more):
        return {**dict.fromkeys(summary.COLUMNS), "id": name, "state": state, "doubts": doubts, "outlier_of": [],
                "worst_interval_95_mm": worst, **more}

    def test_failures_then_doubts_then_the_worst_error(self):
        rows = [self.row("calm"), self.row("left", "left", None, None), self.row("wide", worst=9.0),
                self.row("doubted", doubts=2), self.row("failed", "failed", None, None)]
        self.assertEqual([row["id"] for row in sorted(rows, key=summary.order)],
                         ["failed", "doubted", "wide", "calm", "left"])

    def test_outliers_are_those_for_the_worse(self):
        values = numpy.random.default_rng(1).lognormal(0, 0.2, 40)
        rows = [self.row(str(k), worst=value, least_j=0.8 + 0.001 * k) for k, value in enumerate(values)]
        rows += [self.row("wide", worst=6.0, least_j=0.81), self.row("narrow", worst=0.01, least_j=0.81),
                 self.row("folded", worst=1.0, least_j=-0.5)]
        summary.mark_outliers(rows)
        self.assertEqual({row["id"]: row["outlier_of"] for row in rows if row["outlier_of"]},
                         {"wide": ["worst_interval_95_mm"], "folded": ["least_j"]})

    def test_few_pairs_have_no_outliers(self):
        rows = [self.row(str(k), worst=1.0 + 0.01 * k) for k in range(5)] + [self.row("wide", worst=100.0)]
        summary.mark_outliers(rows)
        self.assertFalse(any(row["outlier_of"] for row in rows))

    def test_every_value_is_in_a_bin(self):
        for values in ([1.0, 1.0], [0.1, 1, 10, 100], list(range(500)), [-1.0, 2.0]):
            edges, counts = histogram.bins_of(values, True)
            self.assertEqual(sum(counts), len(values))
            self.assertAlmostEqual(edges[0], min(values))

    def test_what_is_asked_for_falls_into_few_classes(self):
        self.assertEqual(plan.asked(50, 700), {"memory_mb": 2048, "minutes": 2})
        self.assertEqual(plan.asked(1000, 20), {"memory_mb": 512, "minutes": 32})


class Plans(Folder):
    def test_records_of_other_options_go(self):
        """Slurm's arrays take a record for the end of a job."""
        layout = Layout(self.folder)
        job = {"kind": "pair", "id": "a", "patient": None, "files": {}, "options": {"rounds": ["3"]},
               "program": {"version": "1", "sha256": ""}, "asked": {"memory_mb": 512, "minutes": 2}}
        (self.folder / "out").write_text("result")
        digests.write_json(layout.record("pair", "a"), {"request": plan.request_of(job), "inputs": {}, "outputs": {
            "out": digests.entry_of(str(self.folder / "out"))}})
        self.assertTrue(plan.is_done(layout, job))
        other = {**job, "options": {"rounds": ["4"]}}
        self.assertFalse(plan.is_done(layout, other))
        written = types.SimpleNamespace(layout=layout, settings={}, left=[other], patients_left=[])
        plan.write_plan(written)
        self.assertFalse(pathlib.Path(layout.record("pair", "a")).exists())

    def test_what_another_try_does_not_change(self):
        files = {"fixed": ["/data/image.nii.gz"]}
        for why, code, lasting in (("'/data/image.nii.gz' is cut short", 3, True), ("cannot write '/out/x': No space left", 3, False),
                                   ("no equilibrium", 4, True), ("killed by signal 9", -9, False)):
            self.assertEqual(job.is_lasting({"files": files}, why, code), lasting, why)


class Devices(Folder):
    def test_jobs_spread_before_they_share(self):
        self.assertEqual(devices.slots({"devices": ["gpu:0", "gpu:1"], "per_device": 2}),
                         [("gpu:0", 0), ("gpu:1", 0), ("gpu:0", 1), ("gpu:1", 1)])

    def test_a_device_is_lent_once(self):
        layout = Layout(self.folder)
        digests.write_json(layout.plan, {"settings": {"devices": ["gpu:0", "gpu:3"], "per_device": 1}})
        with devices.taken(layout, "gpu") as first, devices.taken(layout, "gpu") as second:
            self.assertEqual((first, second), ("gpu:0", "gpu:3"))
            with devices.taken(layout, "cpu") as third:
                self.assertEqual(third, "")
        with devices.taken(layout, "gpu") as again:
            self.assertEqual(again, "gpu:0")


class Groups(Folder):
    """Fields whose compositions are known: each moves all points alike, or stretches them about the origin."""
    SHAPE, MATRIX = (12, 14, 16), numpy.diag([2.0, 2.0, 2.0, 1.0])

    def pair(self, source, target, forward, backward):
        layout, name = Layout(self.folder), f"{source}{target}"
        folder = pathlib.Path(layout.pair(name))
        folder.mkdir(parents=True)
        places = fields.places_of(self.SHAPE, self.MATRIX)
        for file, move in (("displacement_moving_to_fixed", forward), ("displacement_fixed_to_moving", backward)):
            values = (move(places) - places).reshape(*self.SHAPE, 3, order="F").astype(numpy.float32)
            fields.write_nifti(folder / f"{file}.nii.gz", values, self.MATRIX, vectors=True)
        digests.write_json(layout.record("pair", name), {"id": name})
        return {"id": name, "patients": [source, target], "files": {}}

    def shifted(self, source, target, shift):
        return self.pair(source, target, lambda x: x + shift, lambda x: x - shift)

    def test_a_field_is_written_as_it_is_read(self):
        job = self.shifted("A", "B", numpy.array([1.0, 2.0, -3.0]))
        path = pathlib.Path(Layout(self.folder).pair(job["id"])) / "displacement_moving_to_fixed.nii.gz"
        image = nibabel.load(path)
        self.assertEqual(image.shape, (*self.SHAPE, 1, 3))
        numpy.testing.assert_allclose(image.affine, numpy.diag([-2, -2, 2, 1]))
        numpy.testing.assert_allclose(fields.Field(path)(numpy.array([[3.0, 4.0, 5.0]])), [[4, 6, 2]], atol=1e-6)
        self.assertTrue(numpy.isnan(fields.Field(path)(numpy.array([[-3.0, 4.0, 5.0]]))).all())

    def test_a_loop_misses_by_what_its_pairs_do_not_undo(self):
        shift = numpy.array([1.0, 0.5, -0.5])
        jobs = [self.shifted("A", "B", shift), self.shifted("B", "C", shift),
                self.shifted("C", "A", -2 * shift + [0, 0, 0.7])]
        rows = groups.write_loops(groups.Atlas(Layout(self.folder), jobs), self.folder)
        self.assertEqual([row["loop"] for row in rows], ["A → B → C → A"])
        self.assertAlmostEqual(rows[0]["mean_mm"], 0.7, places=5)
        self.assertGreater(rows[0]["left_the_grid"], 0)

    def test_the_mean_goes_through_chains(self):
        one, two = numpy.array([3.0, 0.0, 0.0]), numpy.array([0.0, -3.0, 0.0])
        jobs = [self.shifted("A", "B", one), self.shifted("C", "B", two)]
        atlas = groups.Atlas(Layout(self.folder), jobs)
        self.assertEqual(atlas.chain("A", "C"), [("A", "B"), ("B", "C")])
        words = groups.write_mean(atlas, "A", self.folder)
        self.assertIn("Mean of 3 patients in the frame of A", words)
        mean = fields.Field(self.folder / "mean_displacement.nii.gz")
        middle = numpy.array([[10.0, 10.0, 14.0]])  # A stays, B is 3 away, C is 3 and 3 away
        numpy.testing.assert_allclose(mean(middle) - middle, [[2.0, 1.0, 0.0]], atol=1e-5)

    def test_the_mean_shape_is_carried_forward(self):
        labels = numpy.zeros(self.SHAPE, numpy.int16)
        labels[3:7, 4:8, 5:9] = 2
        fields.write_nifti(self.folder / "labels.nii.gz", labels, self.MATRIX)
        job = self.shifted("A", "B", numpy.array([4.0, 0.0, -8.0]))  # half of it: one and two voxels
        job["files"] = {"moving-labels": [str(self.folder / "labels.nii.gz")]}
        groups.write_mean(groups.Atlas(Layout(self.folder), [job]), "A", self.folder)
        shape, _ = fields.read_nifti(self.folder / "mean_shape.nii.gz")
        expected = numpy.zeros(self.SHAPE, numpy.int16)
        expected[4:8, 4:8, 3:7] = 2
        numpy.testing.assert_array_equal(shape[..., 0], expected)

    def test_unlinked_patients_are_named(self):
        jobs = [self.shifted("A", "B", numpy.zeros(3)), self.shifted("C", "D", numpy.zeros(3))]
        self.assertIn("Not linked to it: C, D", groups.write_mean(groups.Atlas(Layout(self.folder), jobs), "A", self.folder))


class Foretold(Folder):
    def test_images_that_are_matched_take_memory(self):
        pair = types.SimpleNamespace(files={"moving": 0, "fixed": 0}, options={}, voxels=(8_400_000, 8_400_000), voxel_mm3=1.0)
        self.assertGreater(foretell.of_pair(pair)[1], 3100)  # the largest of the real pairs
        pair.files["fixed-labels"] = 0
        self.assertLess(foretell.of_pair(pair)[1], 1100)
        pair.options["match-image"] = []
        self.assertGreater(foretell.of_pair(pair)[1], 3100)

    def test_runs_teach(self):
        for number in range(6):
            digests.write_json(self.folder / "done" / f"{number}.json", {
                "foretold": {"seconds": 10, "memory_mb": 100}, "took": {"seconds": 60, "memory_mb": 50, "threads": 1}})
        scale = foretell.Scale(self.folder)
        self.assertEqual((scale.runs, scale.seconds, scale.memory), (6, 3.0, 0.5))
        (self.folder / "done" / "0.json").write_text("{")
        self.assertEqual(foretell.Scale(self.folder).runs, 5)


class Thumbnails(Folder):
    def test_a_picture_of_the_worst_slice(self):
        grey = numpy.zeros((20, 30, 10), numpy.int16)
        grey[5:9, 10:14, 7] = 500
        affine = numpy.diag([-1.0, -1, 2, 1])
        nibabel.save(nibabel.Nifti1Image(grey, affine), self.folder / "warped.nii.gz")
        digests.write_json(self.folder / "report.json", {"error_estimate": {"worst_place_mm": [3, 3, 14]}})
        data = thumbnail.picture(str(self.folder))
        self.assertTrue(data.startswith(b"\x89PNG"))
        grid = headers.grid_of(str(self.folder / "warped.nii.gz"))
        self.assertEqual(thumbnail.nearest_slice(grid, [3, 3, 14]), 7)
        self.assertEqual(thumbnail.nearest_slice(grid, None), 5)

    def test_the_slice_is_one_with_tissue_in_the_fixed_frame(self):
        values = numpy.full((20, 20, 12), numpy.nan, numpy.float32)
        values[5:15, 5:15, 3:6] = 1.5
        nibabel.save(nibabel.Nifti1Image(values, numpy.diag([-1.0, -1, 2, 1])), self.folder / "uncertainty.nii.gz")
        slices = thumbnail.Slices(str(self.folder / "uncertainty.nii.gz"))
        self.assertEqual(thumbnail.slice_with_tissue(slices, 11, range(20), range(20)), 5)
        self.assertEqual(thumbnail.slice_with_tissue(slices, 4, range(20), range(20)), 4)
        moved = {"error_estimate": {"worst_place_mm": [1, 2, 3]},
                 "alignment": {"matrix": [[0, -1, 0, 10], [1, 0, 0, 20], [0, 0, 1, 30], [0, 0, 0, 1]]}}
        self.assertEqual(thumbnail.place_in_fixed(moved), [8, 21, 33])

    def test_no_image_no_picture(self):
        thumbnail.write(str(self.folder))
        self.assertEqual(list(self.folder.iterdir()), [])


if __name__ == "__main__":
    unittest.main()
