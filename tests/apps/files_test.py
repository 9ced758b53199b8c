"""Files that say of themselves what most do not: two places, names. What the reader decided reaches every verb."""

import json
import struct
import unittest

import nibabel
import numpy

from phantom import CENTRE_LPS, MOVING_AFFINE, PhantomTest, SIZE, lps_of_voxels, run, save

INPUT = 2
NOTE = "sform and qform disagree by up to 30 voxels"

SCENE = """
[geometry]
labels = "LABELS"
edge_length_mm = 8
[label.1]
youngs_modulus_kpa = 3.0
poissons_ratio = 0.3
[label.2]
youngs_modulus_kpa = 3.0
poissons_ratio = 0.3
[set.base]
half_space = { point_mm = [0, 0, 6], normal = [0, 0, 1] }
[[fixed]]
set = "base"
[gravity]
to = [0, 0, -1]
[solve]
frames = 1
"""


def segmentation(path, labels, names):
    """A .seg.nrrd of 3D Slicer with one layer, in LPS."""
    origin = MOVING_AFFINE[:3, 3] * [-1, -1, 1]
    fields = ["NRRD0004", "type: uint8", "dimension: 3", "space: left-posterior-superior",
              f"sizes: {SIZE} {SIZE} {SIZE}", "space directions: (1,0,0) (0,1,0) (0,0,1)",
              "kinds: domain domain domain", "encoding: raw", "space origin: ({},{},{})".format(*origin)]
    for number, (label, name) in enumerate(names.items()):
        fields += [f"Segment{number}_ID:=s{number}", f"Segment{number}_Name:={name}",
                   f"Segment{number}_LabelValue:={label}", f"Segment{number}_Layer:=0"]
    path.write_bytes("\n".join(fields + ["", ""]).encode() + labels.tobytes(order="F"))
    return path


class TwoPlaces(PhantomTest):
    """The qform lies 30 mm from the sform and is used, as ITK does."""

    def setUp(self):
        super().setUp()
        self.labels = self.two_places(self.phantom.moving_labels_array, MOVING_AFFINE, "two_places.nii")

    def two_places(self, array, affine, name):
        path = save(array, affine, self.phantom.folder / name)
        data = bytearray(path.read_bytes())
        data[252:256] = struct.pack("<hh", 1, 2)
        data[292:296] = struct.pack("<f", affine[0, 3] + 30)
        path.write_bytes(data)
        return path

    def assert_said(self, text):
        self.assertIn(NOTE, text)
        self.assertIn("two_places.nii", text)

    def test_register_says_so_on_the_terminal_in_the_report_and_on_the_page(self):
        result = self.phantom.register("--no-error-estimate", "--edge-length", 6, moving=None, fixed=None,
                                       moving_labels=self.labels)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_said(result.stdout)
        self.assert_said(" ".join(json.loads((self.phantom.output / "report.json").read_text())["notes"]))
        self.assertIn(NOTE, (self.phantom.output / "report.html").read_text())

    def test_a_dry_run_says_so(self):
        result = self.phantom.register("--dry-run", moving=None, moving_labels=self.labels)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_said(result.stdout)

    def test_mesh_says_so(self):
        report = self.phantom.folder / "mesh.json"
        result = run("mesh", self.labels, "-o", self.phantom.folder / "a.vtu", "--edge-length", 8, "--json", report)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_said(result.stdout)
        self.assert_said(" ".join(json.loads(report.read_text())["notes"]))

    def test_simulate_and_explain_say_so(self):
        scene = self.phantom.folder / "scene.toml"
        scene.write_text(SCENE.replace("LABELS", self.labels.name))
        result = run("simulate", scene, "-o", self.phantom.output)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_said(result.stdout)
        self.assert_said(" ".join(json.loads((self.phantom.output / "summary.json").read_text())["notes"]))
        self.assert_said(run("explain", scene).stdout)

    def test_evaluate_says_so(self):
        scores = self.phantom.folder / "scores.json"
        result = run("evaluate", "--labels", self.labels, "--reference-labels", self.labels, "--json", scores)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_said(result.stdout)
        self.assert_said(" ".join(json.loads(scores.read_text())["notes"]))

    def test_warp_says_so(self):
        field = save(numpy.zeros((SIZE, SIZE, SIZE, 1, 3), numpy.float32), MOVING_AFFINE, self.phantom.folder / "f.nii")
        data = bytearray(field.read_bytes())
        data[68:70] = struct.pack("<h", 1007)
        field.write_bytes(data)
        warped = self.phantom.folder / "warped.nii.gz"
        result = run("warp", self.labels, "-o", warped, "--labels", "--displacement", field)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assert_said(result.stdout)


class Kinds(PhantomTest):
    def test_a_grey_image_is_refused_as_labels(self):
        grey = numpy.random.default_rng(1).integers(0, 400, size=(SIZE, SIZE, SIZE)).astype(numpy.int16)
        path = save(grey, MOVING_AFFINE, self.phantom.folder / "grey.nii.gz")
        self.assert_refused(self.phantom.register(moving=None, moving_labels=path), INPUT, "grey.nii.gz", "grey image")

    def test_info_describes_a_field_of_three_components(self):
        vectors = numpy.zeros((5, 6, 7, 1, 3), numpy.float32)
        vectors[2, 3, 4, 0] = [-1.5, 0, 2.5]
        path = save(vectors, MOVING_AFFINE, self.phantom.folder / "field.nii.gz")
        result = run("info", path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("3 components", result.stdout)
        self.assertIn("-1.5 to 2.5", result.stdout)

    def field(self, values, name, affine=MOVING_AFFINE):
        """Vectors (i, j, k, 3), on the moving grid if no other is named, NIfTI intent 1007."""
        image = nibabel.Nifti1Image(values.astype(numpy.float32)[:, :, :, None, :], affine)
        image.header.set_intent(1007)
        image.header.set_xyzt_units("mm")
        nibabel.save(image, str(self.phantom.folder / name))
        return self.phantom.folder / name

    def test_a_field_of_positions_is_no_field_of_displacements(self):
        positions = lps_of_voxels(MOVING_AFFINE)
        good = run("evaluate", "--displacement", self.field(0.1 * (positions - CENTRE_LPS), "good.nii.gz"))
        self.assertEqual(good.returncode, 0, good.stderr)
        for values, frame in ((positions + [1, 2, 3], "LPS"), (1.05 * positions * [-1, -1, 1], "RAS"),
                              (positions * [1, -1, 1], "of axes of their own")):
            path = self.field(values, "positions.nii.gz")
            self.assert_refused(run("evaluate", "--displacement", path), INPUT, f"positions ({frame})", "subtract")
            self.assert_refused(run("warp", self.phantom.moving, "-o", self.phantom.folder / "w.nii.gz",
                                    "--displacement", path), INPUT, f"positions ({frame})")

    def test_a_field_of_voxels_is_no_field_of_displacements(self):
        shape = (24, 30, 20)
        voxels = numpy.stack(numpy.meshgrid(*map(numpy.arange, shape), indexing="ij"), axis=-1).astype(float)
        bent = voxels + 2 * numpy.sin(voxels[..., ::-1] / 5) + [2, -1, 0]  # a few voxels from the identity
        turned = numpy.array([[0.0, 2, 0, -20], [0, 0, -2, 40], [2, 0, 0, -10], [0, 0, 0, 1]])  # sagittal
        for affine in (MOVING_AFFINE, numpy.diag([2.0, 2, 2, 1]), numpy.diag([-0.7, -0.7, 3.3, 1]), turned):
            for values in (voxels, bent):
                path = self.field(values, "voxels.nii.gz", affine)
                self.assert_refused(run("evaluate", "--displacement", path), INPUT, "voxels.nii.gz",
                                    "positions (in voxels)", "subtract")
        self.assert_refused(self.phantom.register("--dry-run", "--initial-transform", path), INPUT, "voxels.nii.gz",
                            "positions (in voxels)")
        # Tissue that is stretched by 1 mm per voxel, and motions of the size of the grid.
        coarse = numpy.diag([-3.3, -3.3, 3.3, 1])
        places = lps_of_voxels(coarse, shape)
        stretched = 0.3 * (places - places.mean(axis=(0, 1, 2)))
        cycle = places[..., [1, 2, 0]] - places  # a turn by 120 degrees
        for values in (stretched, stretched + [4, -6, 5], cycle, 0 * places + numpy.array(shape) / 2):
            result = run("evaluate", "--displacement", self.field(values, "good.nii.gz", coarse))
            self.assertEqual(result.returncode, 0, result.stderr)

    def test_markups_are_points_for_every_verb(self):
        path = self.phantom.folder / "points.fcsv"
        path.write_text("# CoordinateSystem = RAS\n# columns = x,y,z,label\n1,2,3,tip\n4,5,6,base\n")
        result = run("info", path)
        self.assertIn("2 points", result.stdout + result.stderr)
        field = self.field(numpy.ones((SIZE, SIZE, SIZE, 3)), "ones.nii.gz")
        warped = self.phantom.folder / "warped.csv"
        result = run("warp", path, "-o", warped, "--displacement", field)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertEqual(warped.read_text().splitlines()[1], "0.000000,-1.000000,4.000000")
        self.assert_refused(run("warp", path, "-o", self.phantom.folder / "warped.fcsv", "--displacement", field),
                            INPUT, ".csv")

    def test_names_in_upper_case(self):
        path = self.phantom.moving_labels.rename(self.phantom.folder / "LABELS.NII.GZ")
        result = run("info", "--labels", path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("centroid", result.stdout)

    def test_segments_have_names(self):
        path = segmentation(self.phantom.folder / "a.seg.nrrd", self.phantom.moving_labels_array,
                            {1: "shell", 2: "core"})
        result = run("info", "--labels", path)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("'shell'", result.stdout)
        self.assertIn("'core'", result.stdout)

    def test_one_name_with_two_numbers_is_refused(self):
        folder, phantom = self.phantom.folder, self.phantom
        moving = segmentation(folder / "m.seg.nrrd", phantom.moving_labels_array, {1: "shell", 2: "core"})
        fixed = segmentation(folder / "f.seg.nrrd", phantom.moving_labels_array, {1: "core", 2: "shell"})
        result = phantom.register(moving=None, fixed=None, moving_labels=moving, fixed_labels=fixed)
        self.assert_refused(result, INPUT, "m.seg.nrrd", "f.seg.nrrd", "'shell'", "label 2")

    def test_evaluate_refuses_one_name_with_two_numbers(self):
        folder, labels = self.phantom.folder, self.phantom.moving_labels_array
        one = segmentation(folder / "m.seg.nrrd", labels, {1: "shell", 2: "core"})
        other = segmentation(folder / "f.seg.nrrd", labels, {1: "core", 2: "shell"})
        self.assert_refused(run("evaluate", "--labels", one, "--reference-labels", other), INPUT, "m.seg.nrrd",
                            "f.seg.nrrd", "'shell'", "label 2")

    def test_lengths_of_labels_that_a_map_lacks_are_refused(self):
        labels, folder = self.phantom.moving_labels, self.phantom.folder
        result = run("mesh", labels, "-o", folder / "a.vtu", "--label-edge-length", "9=3")
        self.assert_refused(result, INPUT, labels.name, "--label-edge-length", "label 9 is absent", "1, 2")
        scene = folder / "scene.toml"
        scene.write_text(SCENE.replace("LABELS", labels.name).replace("edge_length_mm = 8",
                         "edge_length_mm = 8\nlabel_edge_length_mm = { 9 = 3 }"))
        result = run("simulate", scene, "-o", folder / "out")
        self.assert_refused(result, INPUT, "label 9 has an edge length", "labels 1, 2 only")

    def test_a_contact_surface_in_metres_is_refused(self):
        folder = self.phantom.folder
        (folder / "wall.obj").write_text("v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
                                         "f 2 3 4\n")
        scene = folder / "scene.toml"
        scene.write_text(SCENE.replace("LABELS", self.phantom.moving_labels.name) +
                         '[[contact]]\nsurface = "wall.obj"\n')
        self.assert_refused(run("simulate", scene, "-o", folder / "out"), INPUT, "wall.obj", "in metres?")


if __name__ == "__main__":
    unittest.main()
