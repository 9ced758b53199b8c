"""compound: a sweep of a tracked probe through the command line, against what its frames show, and what is refused."""

import pathlib
import tempfile
import unittest

import nibabel
import numpy

from phantom import run

PIXEL = numpy.array([0.35, 0.3])  # mm
SIZE = (90, 70, 50)  # columns, rows, frames


def brightness(ras):
    return 120 + 50 * numpy.sin(ras[..., 0] / 7) + 40 * numpy.cos(ras[..., 1] / 6 - ras[..., 2] / 8)


def turn(axis, degrees):
    a = numpy.radians(degrees)
    matrix = numpy.eye(4)
    i, j = [n for n in range(3) if n != axis]
    matrix[i, i] = matrix[j, j] = numpy.cos(a)
    matrix[i, j], matrix[j, i] = -numpy.sin(a), numpy.sin(a)
    return matrix


def shift(x, y, z):
    matrix = numpy.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


class Sweep:
    """A probe that a hand moves over a patient whose Reference is tracked, too."""

    def __init__(self, seed):
        random = numpy.random.default_rng(seed)
        self.image_to_probe = shift(*random.normal(0, 20, 3)) @ turn(int(random.integers(3)), random.uniform(-180, 180)) \
            @ numpy.diag([*PIXEL, 0.3, 1])
        self.reference_to_tracker = shift(*random.normal(0, 100, 3)) @ turn(0, random.uniform(-180, 180)) @ turn(2, 50)
        self.image_to_reference = []
        hand = shift(*random.normal(0, 30, 3)) @ turn(int(random.integers(3)), random.uniform(-180, 180))
        for _ in range(SIZE[2]):
            hand = hand @ shift(*random.normal(0, 0.1, 2), random.uniform(0.3, 0.9)) @ turn(1, random.normal(0, 0.2))
            self.image_to_reference.append(hand @ numpy.diag([*PIXEL, 0.3, 1]))
        columns, rows = numpy.meshgrid(numpy.arange(SIZE[0]), numpy.arange(SIZE[1]))
        pixels = numpy.stack([columns, rows, 0 * rows, 0 * rows + 1], -1)
        self.fan = (numpy.hypot(columns - 45, rows + 30) < 95) & (abs(columns - 45) < 0.5 * (rows + 30))
        self.frames = numpy.full((SIZE[2], SIZE[1], SIZE[0]), 9, numpy.uint8)
        for n, matrix in enumerate(self.image_to_reference):
            self.frames[n][self.fan] = numpy.round(brightness(pixels @ matrix.T))[self.fan]

    def fields(self, n, calibrated):
        probe_to_tracker = self.reference_to_tracker @ self.image_to_reference[n] @ numpy.linalg.inv(self.image_to_probe)
        fields = {"ProbeToTracker": probe_to_tracker, "ReferenceToTracker": self.reference_to_tracker}
        if calibrated:
            fields["ImageToProbe"] = self.image_to_probe
        return fields

    def save(self, path, calibrated=True, invalid=()):
        lines = ["ObjectType = Image", "NDims = 3", "BinaryData = True", "BinaryDataByteOrderMSB = False",
                 "CompressedData = False", "TransformMatrix = 1 0 0 0 1 0 0 0 1", "Offset = 0 0 0",
                 "ElementSpacing = 1 1 1", "UltrasoundImageOrientation = MF", "UltrasoundImageType = BRIGHTNESS",
                 "DimSize = " + " ".join(map(str, SIZE)), "ElementType = MET_UCHAR"]
        for n in range(SIZE[2]):
            for name, matrix in self.fields(n, calibrated).items():
                lines.append(f"Seq_Frame{n:04d}_{name}Transform = " + " ".join(f"{v:.9g}" for v in matrix.flat))
                lines.append(f"Seq_Frame{n:04d}_{name}TransformStatus = {'INVALID' if n in invalid else 'OK'}")
            lines.append(f"Seq_Frame{n:04d}_Timestamp = {0.05 * n}")
        path.write_bytes("\n".join([*lines, "ElementDataFile = LOCAL", ""]).encode() + self.frames.tobytes())
        return path


def plus_configuration(sweep):
    numbers = " ".join(f"{v:.9g}" for v in sweep.image_to_probe.flat)
    return ('<PlusConfiguration version="2.9"><CoordinateDefinitions>\n'
            '<Transform From="Reference" To="Tracker" Matrix="1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1" />\n'
            f'<Transform From="Image" To="Probe"\n  Matrix="{numbers}" Error="0.6" />\n'
            "</CoordinateDefinitions></PlusConfiguration>\n")


class Compounding(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)

    def compound(self, source, *more):
        result = run("compound", source, "--output", self.folder / "us.nii.gz", *more)
        self.assertEqual(result.returncode, 0, result.stderr)
        return nibabel.load(self.folder / "us.nii.gz"), result.stdout

    def errors(self, image):
        values = numpy.asarray(image.dataobj)
        seen = numpy.argwhere(values > 0)
        places = nibabel.affines.apply_affine(image.affine, seen)
        return values[tuple(seen.T)] - brightness(places)

    def test_random_sweeps_are_where_their_frames_are(self):
        for seed in range(6):
            with self.subTest(seed=seed):
                sweep = Sweep(seed)
                image, said = self.compound(sweep.save(self.folder / "s.mha"))
                errors = self.errors(image)
                self.assertLess(numpy.sqrt(numpy.mean(errors**2)), 1.5)
                self.assertGreater(errors.size * 0.5**3, 0.8 * sweep.fan.sum() * PIXEL.prod() * 0.6 * (SIZE[2] - 1))
                self.assertIn("50 frames of pixels of 0.35 x 0.3 mm", said)

    def test_a_calibration_of_its_own(self):
        sweep = Sweep(11)
        source = sweep.save(self.folder / "s.mha", calibrated=False)
        refused = run("compound", source, "--output", self.folder / "none.nii.gz")
        self.assertEqual(refused.returncode, 2, refused.stderr)
        self.assertIn("--calibration", refused.stderr)
        self.assertFalse((self.folder / "none.nii.gz").exists())
        rows = self.folder / "rows.txt"
        numpy.savetxt(rows, sweep.image_to_probe)
        plus = self.folder / "plus.xml"
        plus.write_text(plus_configuration(sweep))
        for calibration in (rows, plus):
            image, _ = self.compound(source, "--calibration", calibration)
            self.assertLess(numpy.sqrt(numpy.mean(self.errors(image)**2)), 1.5)

    def test_axes_systems_and_frames_left_out(self):
        sweep = Sweep(12)
        source = sweep.save(self.folder / "s.mha", invalid=(0, 7))
        image, said = self.compound(source)
        self.assertIn("note: 2 of 50 frames", said)
        turned, _ = self.compound(source, "--axes", "lps")
        numpy.testing.assert_allclose(
            nibabel.affines.apply_affine(turned.affine, numpy.array(turned.shape) / 2)[:2],
            -nibabel.affines.apply_affine(image.affine, numpy.array(image.shape) / 2)[:2], atol=1)
        result = run("compound", source, "--output", self.folder / "x.nii.gz", "--to", "World")
        self.assertEqual(result.returncode, 2)
        self.assertIn("Image, Probe, Reference, Tracker", result.stderr)

    def test_the_input_is_not_written_over(self):
        source = Sweep(14).save(self.folder / "s.mha")
        before = source.read_bytes()
        result = run("compound", source, "--output", self.folder / ".." / self.folder.name / "s.mha")
        self.assertEqual(result.returncode, 2, result.stderr)
        self.assertIn("another name", result.stderr)
        self.assertEqual(source.read_bytes(), before)

    def test_frames_are_no_volume(self):
        source = Sweep(13).save(self.folder / "s.mha")
        for verb in (["info", source], ["register", "--moving", source, "--fixed", source, "--moving-labels", source,
                                        "--output", self.folder / "out"]):
            result = run(*verb)
            self.assertEqual(result.returncode, 2, result.stderr)
            self.assertIn("tissuewarp compound", result.stderr)


if __name__ == "__main__":
    unittest.main()
