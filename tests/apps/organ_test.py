"""Where the organ is said by something other than a label map: the image alone, a surface, tetrahedra."""

import json
import struct
import unittest

import numpy

from image_test import landmarks_of, texture
from phantom import (CENTRE_LPS, FIXED_AFFINE, FIXED_AXES, MOVING_AFFINE, MOVING_AXES, PhantomTest, SHIFT_LPS, run, save)

INPUT = 2


def organ_image(affine, centre, axes, labels):
    """A textured organ in the dark of air, which is nowhere quite dark, with a hole."""
    grey = numpy.where(labels == 1, texture(affine, centre, axes), 20)
    return (grey + numpy.random.default_rng(2).normal(0, 3, labels.shape)).astype(numpy.float32)


def element(group, number, kind, value):
    """Of DICOM, in explicit little-endian transfer syntax."""
    data = value if isinstance(value, bytes) else value.encode()
    data += b" " * (len(data) % 2)
    head = struct.pack("<HH", group, number) + kind.encode()
    return head + (struct.pack("<HI", 0, len(data)) if kind == "SQ" else struct.pack("<H", len(data))) + data


def sequence(group, number, items):
    return element(group, number, "SQ", b"".join(struct.pack("<HHI", 0xfffe, 0xe000, len(item)) + item
                                                 for item in items))


def contours_of_ellipsoid(centre, axes, heights):
    """A structure set that draws an ellipsoid, at these heights about its middle."""
    turns = numpy.linspace(0, 2 * numpy.pi, 60, endpoint=False)
    planes = []
    for height in heights:
        radius = numpy.sqrt(max(0, 1 - (height / axes[2]) ** 2))
        if radius < 0.1:
            continue
        points = [(centre[0] + axes[0] * radius * numpy.cos(turn), centre[1] + axes[1] * radius * numpy.sin(turn),
                   centre[2] + height) for turn in turns]
        planes.append(element(0x3006, 0x42, "CS", "CLOSED_PLANAR") +
                      element(0x3006, 0x50, "DS", "\\".join(f"{value:.3f}" for point in points for value in point)))
    data = (element(8, 0x60, "CS", "RTSTRUCT") +
            sequence(0x3006, 0x20, [element(0x3006, 0x22, "IS", "1") + element(0x3006, 0x26, "LO", "Left kidney")]) +
            sequence(0x3006, 0x39, [sequence(0x3006, 0x40, planes) + element(0x3006, 0x84, "IS", "1")]))
    meta = element(2, 0x10, "UI", b"1.2.840.10008.1.2.1\0")
    return b"\0" * 128 + b"DICM" + element(2, 0, "UL", struct.pack("<I", len(meta))) + meta + data


class ImagesAlone(PhantomTest):
    """What a user tries first: two images."""

    def setUp(self):
        super().setUp()
        phantom = self.phantom
        phantom.moving = save(organ_image(MOVING_AFFINE, CENTRE_LPS, MOVING_AXES, phantom.moving_labels_array),
                              MOVING_AFFINE, phantom.moving)
        phantom.fixed = save(organ_image(FIXED_AFFINE, CENTRE_LPS + SHIFT_LPS, FIXED_AXES, phantom.fixed_labels_array),
                             FIXED_AFFINE, phantom.fixed)

    def register(self, *more, **replaced):
        return self.phantom.register(*more, **{"moving_labels": None, "fixed_labels": None, **replaced})

    def test_two_images_are_registered_and_what_was_taken_is_said(self):
        result = self.register("--landmarks", landmarks_of(self.phantom), "--edge-length", 4, "--no-error-estimate")
        self.assertEqual(result.returncode, 0, result.stderr)
        report = json.loads((self.phantom.output / "report.json").read_text())
        volume = 4 / 3 * numpy.pi * MOVING_AXES.prod() / 1000
        self.assertAlmostEqual(report["foreground"]["volume_ml"], volume, delta=0.05 * volume)
        self.assertAlmostEqual(report["foreground"]["threshold"], 260, delta=60)
        self.assertLess(report["target_registration_error"]["all"]["after"]["mean"], 0.5)
        for text in (result.stdout, " ".join(report["notes"]), (self.phantom.output / "report.html").read_text()):
            self.assertIn("no labels say where the organ is", text)
            self.assertIn("--moving-labels", text)

    def test_a_dry_run_says_it_too(self):
        result = self.register("--dry-run")
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("largest piece", result.stdout)

    def test_an_image_without_an_organ_is_refused(self):
        shape = self.phantom.moving_array.shape
        noise = numpy.random.default_rng(5).normal(500, 50, size=shape).astype(numpy.float32)
        for name, array in (("noise", noise), ("flat", numpy.full(shape, 7, numpy.float32))):
            path = save(array, MOVING_AFFINE, self.phantom.folder / (name + ".nii.gz"))
            self.assert_refused(self.register(moving=path), INPUT, name, "no organ", "--moving-labels")

    def test_what_speaks_of_labels_takes_some(self):
        self.assert_refused(self.register("--anchor", 1), INPUT, "--anchor", "--moving-labels")
        self.assert_refused(self.register(fixed_labels=self.phantom.fixed_labels), INPUT, "--moving-labels")
        self.assert_refused(run("register", "--fixed-surface", "a.ply", "-o", self.phantom.output), INPUT,
                            "--moving-labels", "docs/which-data.md")


def ellipsoid_triangles(centre, axes, rings=24):
    """T x 3 x 3, outward."""
    latitude = numpy.linspace(0, numpy.pi, rings + 1)
    longitude = numpy.linspace(0, 2 * numpy.pi, 2 * rings + 1)[:-1]
    ring = numpy.stack([numpy.cos(longitude), numpy.sin(longitude), numpy.zeros_like(longitude)], axis=1)
    grid = numpy.stack([ring * numpy.sin(t) + [0, 0, numpy.cos(t)] for t in latitude])
    grid[0], grid[-1] = [0, 0, 1], [0, 0, -1]
    upper, lower = grid[:-1], grid[1:]
    next_upper, next_lower = numpy.roll(upper, -1, axis=1), numpy.roll(lower, -1, axis=1)
    triangles = numpy.concatenate([numpy.stack([upper[1:], lower[1:], next_upper[1:]], axis=2).reshape(-1, 3, 3),
                                   numpy.stack([next_upper[:-1], lower[:-1], next_lower[:-1]], axis=2).reshape(-1, 3, 3)])
    return (triangles * axes + centre).astype(numpy.float32)


def save_stl(triangles, path):
    record = numpy.zeros(len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    record["corners"] = triangles
    path.write_bytes(b"tissuewarp".ljust(80) + numpy.uint32(len(triangles)).tobytes() + record.tobytes())
    return path


class WithoutImages(PhantomTest):
    """A surface or tetrahedra are all that there is of the organ, in the frame of the intraoperative data."""

    def setUp(self):
        super().setUp()
        folder = self.phantom.folder
        self.triangles = ellipsoid_triangles(CENTRE_LPS, MOVING_AXES)
        self.surface = save_stl(self.triangles, folder / "organ.stl")
        self.seen = save_stl(ellipsoid_triangles(CENTRE_LPS + SHIFT_LPS, FIXED_AXES), folder / "seen.stl")
        self.volume = 4 / 3 * numpy.pi * MOVING_AXES.prod()

    def register(self, *more):
        return run("register", "--output", self.phantom.output, "--no-error-estimate", *more)

    def report(self, result):
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads((self.phantom.output / "report.json").read_text())

    def test_a_surface_is_registered_to_a_surface(self):
        report = self.report(self.register("--moving-surface", self.surface, "--fixed-surface", self.seen,
                                           "--no-align", "--edge-length", 4, "--landmarks",
                                           landmarks_of(self.phantom)))
        self.assertLess(report["surface"]["residual_mm"], 0.5)
        self.assertGreater(report["target_registration_error"]["all"]["before"]["mean"], 2)
        self.assertLess(report["target_registration_error"]["all"]["after"]["mean"], 1)
        self.assertAlmostEqual(report["mesh"]["label_volume_mm3"]["1"], self.volume, delta=0.03 * self.volume)
        self.assertIn("sha256", report["inputs"]["moving-surface"])

    def test_a_surface_goes_with_its_image_and_with_labels(self):
        labels = save((self.phantom.fixed_labels_array > 0).astype(numpy.uint8), FIXED_AFFINE,
                      self.phantom.folder / "organ.nii.gz")
        report = self.report(self.register("--moving-surface", self.surface, "--moving", self.phantom.moving,
                                           "--fixed-labels", labels, "--edge-length", 4))
        self.assertGreater(report["overlap"]["after"]["1"]["dice"], 0.97)
        self.assertTrue((self.phantom.output / "warped.nii.gz").exists())

    def test_contours_are_drawn_on_the_voxels_of_their_image(self):
        contours = self.phantom.folder / "rtss.dcm"
        contours.write_bytes(contours_of_ellipsoid(CENTRE_LPS, MOVING_AXES, numpy.arange(-14, 15, 2)))
        labels = save((self.phantom.fixed_labels_array > 0).astype(numpy.uint8), FIXED_AFFINE,
                      self.phantom.folder / "organ.nii.gz")
        result = self.register("--moving-labels", contours, "--moving", self.phantom.moving, "--fixed-labels", labels,
                               "--edge-length", 4)
        report = self.report(result)
        self.assertGreater(report["overlap"]["after"]["1"]["dice"], 0.97)
        self.assertIn("label 1 (Left kidney)", result.stdout)
        self.assertTrue(any("drawn on the image's voxels" in note for note in report["notes"]))

    def test_tetrahedra_are_taken_as_they_are(self):
        mesh = self.phantom.folder / "organ.vtu"
        self.assertEqual(run("mesh", self.phantom.moving_labels, "-o", mesh, "--edge-length", 5).returncode, 0)
        arguments = ("--moving-mesh", mesh, "--fixed-surface", self.seen, "--no-align")
        dry = self.register(*arguments, "--dry-run")
        self.assertIn("tetrahedra as they are", dry.stdout, dry.stderr)
        report = self.report(self.register(*arguments, "--landmarks", landmarks_of(self.phantom)))
        self.assertIn(f"take {report['mesh']['tetrahedra']} tetrahedra", dry.stdout)
        self.assertEqual(set(report["mesh"]["label_volume_mm3"]), {"1", "2"})
        self.assertLess(report["target_registration_error"]["all"]["after"]["mean"], 1)
        self.assert_refused_anew(self.register(*arguments, "--edge-length", 4), "as it is", "--edge-length")

    def assert_refused_anew(self, result, *words):
        self.assertEqual(result.returncode, INPUT, result.stderr)
        for word in words:
            self.assertIn(word, result.stderr)

    def test_an_open_surface_is_refused_with_its_edges(self):
        path = save_stl(self.triangles[1:], self.phantom.folder / "open.stl")
        self.assert_refused(self.register("--moving-surface", path, "--fixed-surface", self.seen), INPUT, "open.stl",
                            "3 open edges", "fill its holes")

    def test_a_surface_in_a_surface_that_faces_outward_is_refused(self):
        inner = ellipsoid_triangles(CENTRE_LPS, 0.6 * MOVING_AXES)
        path = save_stl(numpy.concatenate([self.triangles, inner]), self.phantom.folder / "twice.stl")
        self.assert_refused(self.register("--moving-surface", path, "--fixed-surface", self.seen), INPUT, "twice.stl",
                            "face outward")

    def test_one_file_says_where_the_organ_is(self):
        self.assert_refused(self.register("--moving-surface", self.surface, "--moving-labels",
                                          self.phantom.moving_labels, "--fixed-surface", self.seen), INPUT, "--moving-labels")


if __name__ == "__main__":
    unittest.main()
