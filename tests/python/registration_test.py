"""A registration from end to end: where points go and come from, images, errors, progress, cancelling, exceptions."""

import logging
import os
import signal
import tempfile
import threading
import time
import unittest

import numpy
import tissuewarp

from phantom import CENTRE, EDGE, FIXED, FIXED_LABELS, FIXED_ORIGIN, MOVING, MOVING_LABELS, SHIFT, image


def dice(a, b):
    return 2 * numpy.count_nonzero(a & b) / (numpy.count_nonzero(a) + numpy.count_nonzero(b))


class Registration(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.model = tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE)
        cls.updater = tissuewarp.Updater(cls.model, device="cpu")
        cls.result = cls.updater.update(labels=FIXED_LABELS)
        cls.places = CENTRE + numpy.random.default_rng(1).uniform(-20, 20, (200, 3))  # inside and outside, LPS mm

    def test_points_go_where_the_tissue_went(self):
        moved = self.result.transform([CENTRE])
        self.assertLess(numpy.linalg.norm(moved - (CENTRE + SHIFT)), 0.5)
        self.assertEqual(moved.shape, (1, 3))
        with self.assertRaisesRegex(tissuewarp.InvalidInput, r"\(3,\)"):
            self.result.transform(CENTRE)

    def test_points_come_back(self):
        back = self.result.inverse.transform(self.result.transform(self.places))
        self.assertLess(numpy.linalg.norm(back - self.places, axis=1).max(), 1e-4)

    def test_nodes_go_with_displacement_and_placement(self):
        mesh, placement = self.result.mesh, self.result.placement
        self.assertEqual(self.result.displacement.shape, mesh.nodes.shape)
        self.assertEqual((mesh.tets.shape[1], mesh.labels.shape), (4, (len(mesh.tets),)))
        went = (mesh.nodes + self.result.displacement) @ placement[:3, :3].T + placement[:3, 3]
        numpy.testing.assert_allclose(self.result.transform(mesh.nodes), went, atol=1e-6)
        self.assertFalse(mesh.nodes.flags.writeable)
        self.assertEqual(set(mesh.labels), {1, 2})

    def test_fields_hold_what_points_do(self):
        for transform, field, grid in ((self.result.transform, self.result.field(MOVING), MOVING),
                                       (self.result.inverse.transform, self.result.inverse.field(), FIXED)):
            self.assertEqual(field.array.shape, grid.array.shape + (3,))
            numpy.testing.assert_array_equal(field.affine, grid.affine)
            for z, y, x in ((20, 20, 20), (12, 15, 22), (3, 4, 5)):
                place = grid.origin + grid.spacing * [x, y, z]
                difference = transform([place])[0] - place - field.array[z, y, x]
                self.assertLess(numpy.linalg.norm(difference), 0.02)

    def test_images_and_labels_are_carried(self):
        warped, labels = self.result.warp(MOVING), self.result.warp(MOVING_LABELS, interpolation="nearest")
        numpy.testing.assert_array_equal(warped.affine, FIXED.affine)
        self.assertEqual((warped.array.dtype, labels.array.dtype), (numpy.float32, numpy.int32))
        self.assertGreater(dice(labels.array > 0, FIXED_LABELS.array > 0), 0.95)
        self.assertEqual(self.result.warp(MOVING, grid=MOVING).array.shape, MOVING.array.shape)
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "cubic"):
            self.result.warp(MOVING, interpolation="cubic")

    def test_errors_are_told_of_tissue_alone(self):
        errors = self.result.error(numpy.vstack([CENTRE, CENTRE + 100]))
        self.assertGreater(errors.interval_mm[0], errors.deviation_mm[0])
        self.assertGreater(errors.deviation_mm[0], errors.solver_mm[0])
        self.assertGreater(errors.deviation_mm[0], 0)
        self.assertNotEqual(errors.trust[0], tissuewarp.Trust.OUTSIDE)
        self.assertEqual(errors.trust[1], tissuewarp.Trust.OUTSIDE)
        self.assertTrue(numpy.isnan(errors.deviation_mm[1]))
        trace = numpy.trace(errors.covariance_mm2[0])
        self.assertAlmostEqual(trace, errors.deviation_mm[0] ** 2, delta=1e-6 * trace)
        deviation, trust = self.result.error_image()
        numpy.testing.assert_array_equal(numpy.isnan(deviation.array), trust.array == tissuewarp.Trust.OUTSIDE)

    def test_doubts_speak(self):
        result = tissuewarp.update(self.model, labels=FIXED_LABELS, time_budget=0.001, device="cpu")
        self.assertTrue(result.cut_short)
        [doubt] = [doubt for doubt in result.doubts if doubt.code == "rounds.cut_short"]
        self.assertIn("time budget", doubt.text)
        self.assertIn("allow more time", doubt.remedy)
        self.assertIn(doubt.severity, ("notice", "doubt"))
        count = len(result.doubts)
        result.error([CENTRE])  # a ball of labels can turn: the estimate has its own doubt
        self.assertGreater(len(result.doubts), count)

    def test_labels_elsewhere_are_refused(self):
        far = image(FIXED_LABELS.array, FIXED_ORIGIN + [0, 0, 40])  # another frame, without an alignment
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "same organ"):
            tissuewarp.update(self.model, labels=far, align=False, device="cpu")

    def test_points_of_a_surface(self):
        direction = numpy.random.default_rng(2).normal(size=(400, 3))
        direction /= numpy.linalg.norm(direction, axis=1)[:, None]
        points = CENTRE + SHIFT + direction * [13.8, 13, 12]
        result = self.updater.update(surface=tissuewarp.SurfacePoints(points, deviation=0.3))
        self.assertLess(numpy.linalg.norm(result.transform([CENTRE]) - CENTRE - SHIFT), 1.5)
        self.assertEqual(result.warp(MOVING).array.shape, MOVING.array.shape)  # on the moving grid, carried along

    def test_pairs_of_points(self):
        pairs = tissuewarp.PointPairs(self.result.mesh.nodes[::10], self.result.mesh.nodes[::10] + SHIFT, deviation=0.5)
        result = self.updater.update(points=pairs)
        self.assertLess(numpy.linalg.norm(result.transform([CENTRE]) - CENTRE - SHIFT), 0.5)

    def test_places_that_are_known(self):
        start = numpy.eye(4)
        start[:3, 3] = SHIFT
        result = tissuewarp.update(self.model, labels=FIXED_LABELS, start=start, align=False, device="cpu")
        numpy.testing.assert_array_equal(result.placement, start)
        self.assertLess(numpy.linalg.norm(result.transform([CENTRE]) - CENTRE - SHIFT), 0.5)
        for bad in (2 * start, start[:3, :3], numpy.diag([-1, 1, 1, 1])):
            with self.assertRaisesRegex(tissuewarp.InvalidInput, "rigid"):
                self.updater.update(labels=FIXED_LABELS, start=bad)

    def test_updates_go_on_from_the_last(self):
        again = self.updater.update(labels=FIXED_LABELS, last=self.result)
        self.assertTrue(again.began_at_last, again.why_begun_anew)
        self.assertFalse(self.result.began_at_last)
        apart = numpy.linalg.norm(again.transform(self.places) - self.result.transform(self.places), axis=1)
        self.assertLess(apart.mean(), 0.1)
        pairs = tissuewarp.PointPairs([CENTRE], [CENTRE + SHIFT])
        other = self.updater.update(points=pairs, last=self.result)
        self.assertFalse(other.began_at_last)
        self.assertIn("other kinds of data", other.why_begun_anew)

    def test_images_alone(self):
        edge = tissuewarp.suggested_edge_length_without_labels(MOVING_LABELS)
        self.assertGreater(edge, tissuewarp.suggested_edge_length(MOVING_LABELS))
        model = tissuewarp.prepare(MOVING_LABELS, image=MOVING, edge_length=EDGE)
        result = tissuewarp.update(model, image=FIXED, device="cpu")
        self.assertLess(numpy.linalg.norm(result.transform([CENTRE]) - CENTRE - SHIFT), 1.0)
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "prepare"):
            self.updater.update(image=FIXED)

    def test_meshes_that_exist(self):
        mesh = self.model.mesh
        given = tissuewarp.Mesh(mesh.nodes, mesh.tets, mesh.labels)
        model = tissuewarp.prepare(MOVING_LABELS, mesh=given)
        numpy.testing.assert_array_equal(model.mesh.nodes, mesh.nodes)
        with self.assertRaises(tissuewarp.InvalidInput):
            tissuewarp.Mesh(mesh.nodes, mesh.tets + len(mesh.nodes), mesh.labels)

    def test_materials_matter(self):
        stiff = tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE, materials={2: (300.0, 0.45)})
        other = tissuewarp.update(stiff, labels=FIXED_LABELS, device="cpu")
        self.assertGreater(numpy.abs(other.displacement - self.result.displacement).max(), 0.02)
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "0.5"):
            tissuewarp.prepare(MOVING_LABELS, default_material=(3.0, 0.5))

    def test_labels_slide(self):
        model = tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE, sliding=[(1, 2)])
        mesh = tissuewarp.Updater(model, device="cpu").update(labels=FIXED_LABELS).mesh
        self.assertGreater(len(mesh.nodes), len(numpy.unique(mesh.nodes, axis=0)), "sides have nodes of their own")
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "cannot slide"):
            tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE, sliding=[(1, 1)])

    def test_models_on_disk_give_the_same(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "patient.tw")
            self.model.save(path)
            loaded = tissuewarp.Model.load(path)
        result = tissuewarp.update(loaded, labels=FIXED_LABELS, device="cpu")
        numpy.testing.assert_array_equal(result.displacement, self.result.displacement)

    def test_results_outlive_what_made_them(self):
        displacement = tissuewarp.update(tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE), labels=FIXED_LABELS,
                                         device="cpu").displacement
        numpy.testing.assert_array_equal(displacement, self.result.displacement)


class Calls(unittest.TestCase):
    """How long calls behave."""

    def test_progress_is_told(self):
        told = []
        tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE, progress=lambda *at: told.append(at))
        self.assertGreater(len(told), 3)
        self.assertTrue(all(isinstance(stage, str) and 0 <= part <= 1 for stage, part in told))

    def test_false_cancels(self):
        for allowed in (0, 3):
            told = []

            def progress(stage, fraction):
                told.append(stage)
                return len(told) <= allowed

            with self.assertRaises(tissuewarp.Cancelled):
                tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE, progress=progress)
            self.assertEqual(len(told), allowed + 1)

    def test_what_the_function_raises_comes_out(self):
        def progress(stage, fraction):
            raise KeyError("of the caller")

        with self.assertRaisesRegex(KeyError, "of the caller"):
            tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE, progress=progress)

    def test_one_update_at_a_time(self):
        updater = tissuewarp.Updater(tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE), device="cpu")
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "at work already"):
            updater.update(labels=FIXED_LABELS, progress=lambda *at: updater.update(labels=FIXED_LABELS))
        updater.update(labels=FIXED_LABELS)

    def test_an_interrupt_ends_the_call(self):
        timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        start = time.monotonic()
        with self.assertRaises(KeyboardInterrupt):
            for _ in range(100):
                tissuewarp.prepare(MOVING_LABELS, edge_length=2.0)
        self.assertLess(time.monotonic() - start, 20)

    def test_other_threads_run_meanwhile(self):
        counted = []
        done = threading.Event()

        def count():
            while not done.wait(0.01):
                counted.append(time.monotonic())

        thread = threading.Thread(target=count)
        thread.start()
        start = time.monotonic()
        tissuewarp.prepare(MOVING_LABELS, edge_length=3.0)
        took = time.monotonic() - start
        done.set()
        thread.join()
        self.assertGreater(len(counted), 10 * took)  # of 100 a second

    def test_notes_are_logged(self):
        speck = MOVING_LABELS.array.copy()
        speck[2, 2, 2] = 1  # a piece smaller than an element: the mesher says that it leaves it out
        with self.assertLogs("tissuewarp", logging.INFO) as logs:
            tissuewarp.prepare(image(speck, MOVING_LABELS.origin), edge_length=EDGE)
        self.assertTrue(logs.output)

    def test_an_organ_that_slid_is_logged(self):
        """A ball that turned in its shell of bone by 15°."""
        at = numpy.stack(numpy.meshgrid(*[numpy.arange(62) * 2.0 - 61] * 3, indexing="ij")[::-1], axis=-1)
        a = numpy.radians(15)
        turn = numpy.array([[numpy.cos(a), -numpy.sin(a), 0], [numpy.sin(a), numpy.cos(a), 0], [0, 0, 1]])
        random = numpy.random.default_rng(7)
        waves = [(random.normal(size=3), random.uniform(0, 6)) for _ in range(32)]
        waves = [(2 * numpy.pi / random.uniform(8, 24) * d / numpy.linalg.norm(d), phase) for d, phase in waves]

        def texture(x):
            return sum(numpy.cos(x @ wave + phase) for wave, phase in waves) / 8

        def head(organ):
            r = numpy.linalg.norm(at, axis=-1)
            return numpy.select([r < 40, r < 43, r < 52, r < 58], [60 + 15 * texture(organ), 20, 120 + 40 * texture(at),
                                                                  80 + 20 * texture(at)]).astype(numpy.float32)
        labels = (numpy.linalg.norm(at, axis=-1) < 40).astype(numpy.uint8)
        before, after, labels = (tissuewarp.Image(array, (2, 2, 2), (-61, -61, -61))
                                 for array in (head(at), head(at @ turn), labels))
        model = tissuewarp.prepare(labels, edge_length=12)
        pairs = tissuewarp.PointPairs(model.mesh.nodes, model.mesh.nodes @ turn.T, deviation=0.1)
        result = tissuewarp.update(model, points=pairs, device="cpu")
        with self.assertLogs("tissuewarp", logging.INFO) as logs:
            result.hold_surroundings(before, after)
        self.assertIn("the organ slid", "".join(logs.output))
        still = [48, 0, 0]
        self.assertLess(numpy.linalg.norm(result.transform([still]) - still), 0.5)

    def test_exceptions_are_of_the_right_kind(self):
        model = tissuewarp.prepare(MOVING_LABELS, edge_length=EDGE)
        with self.assertRaisesRegex(ValueError, "label"):
            tissuewarp.prepare(MOVING)  # a grey image
        with self.assertRaises(tissuewarp.InvalidInput):
            tissuewarp.update(model)  # nothing was seen
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "device 'tpu'"):
            tissuewarp.Updater(model, device="tpu")
        with self.assertRaisesRegex(tissuewarp.IoError, "missing.tw"):
            tissuewarp.Model.load("/missing.tw")
        with self.assertRaises(tissuewarp.GpuUnavailable):
            tissuewarp.Updater(model, device="gpu:99")
        for kind in ("InvalidInput", "IoError", "SolverFailure", "GpuUnavailable", "Cancelled"):
            self.assertTrue(issubclass(getattr(tissuewarp, kind), tissuewarp.Error))


if __name__ == "__main__":
    unittest.main()
