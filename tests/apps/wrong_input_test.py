"""Wrong input ends in one line on standard error, the right exit code, and no output."""

import os
import struct
import subprocess
import unittest

import numpy

from phantom import MOVING_AFFINE, FIXED_AFFINE, SIZE, PhantomTest, run, save

INPUT, IO, GPU = 2, 3, 5


class WrongFiles(PhantomTest):
    def test_missing_file(self):
        missing = self.phantom.folder / "nowhere.nii.gz"
        self.assert_refused(self.phantom.register(fixed_labels=missing), IO, "nowhere.nii.gz")

    def test_truncated_file(self):
        path = self.phantom.fixed
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
        self.assert_refused(self.phantom.register(), IO, "fixed.nii.gz")

    def test_not_an_image(self):
        path = self.phantom.folder / "text.nii"
        path.write_text("no image\n")
        self.assert_refused(self.phantom.register(moving_labels=path), IO, "text.nii")

    def test_two_dimensional_image(self):
        path = save(self.phantom.moving_labels_array[:, :, 24], MOVING_AFFINE, self.phantom.folder / "flat.nii.gz")
        self.assert_refused(self.phantom.register(moving=None, moving_labels=path), INPUT, "flat.nii.gz",
                            "(docs/manual/images.md)")

    def test_vector_image_in_place_of_grey(self):
        vectors = numpy.zeros((SIZE, SIZE, SIZE, 1, 3), numpy.float32)
        path = save(vectors, MOVING_AFFINE, self.phantom.folder / "vectors.nii.gz")
        self.assert_refused(self.phantom.register(moving=path), INPUT, "vectors.nii.gz")

    def test_non_finite_voxels(self):
        array = self.phantom.moving_array.copy()
        array[10, 20, 30] = numpy.nan
        path = save(array, MOVING_AFFINE, self.phantom.folder / "nan.nii.gz")
        self.assert_refused(self.phantom.register(moving=path), INPUT, "nan.nii.gz", "finite")

    def test_zero_spacing(self):
        path = save(self.phantom.fixed_labels_array, FIXED_AFFINE, self.phantom.folder / "zero.nii")
        data = bytearray(path.read_bytes())
        data[80:84] = struct.pack("<f", 0.0)  # pixdim[1]
        data[252:256] = struct.pack("<hh", 1, 0)  # qform given, no sform
        path.write_bytes(data)
        self.assert_refused(self.phantom.register(fixed=None, fixed_labels=path), INPUT, "zero.nii", "spacing")

    def test_spacing_in_centimetres(self):
        affine = MOVING_AFFINE @ numpy.diag([0.1, 0.1, 0.1, 1])
        path = save(self.phantom.moving_labels_array, affine, self.phantom.folder / "centimetres.nii.gz")
        self.assert_refused(self.phantom.register(moving=None, moving_labels=path), INPUT, "centimetres.nii.gz",
                            "spans 4.8 mm", "millimetres")


class WrongLabels(PhantomTest):
    def test_image_and_labels_on_different_grids(self):
        affine = MOVING_AFFINE.copy()
        affine[0, 3] += 0.5
        path = save(self.phantom.moving_labels_array, affine, self.phantom.folder / "shifted.nii.gz")
        self.assert_refused(self.phantom.register(moving_labels=path), INPUT, "shifted.nii.gz", "0.5 voxels",
                            "--resample-labels")

    def test_image_and_labels_of_different_size(self):
        path = save(self.phantom.fixed_labels_array[:40], FIXED_AFFINE, self.phantom.folder / "short.nii.gz")
        self.assert_refused(self.phantom.register(fixed_labels=path), INPUT, "48x48x48", "40x48x48")

    def test_empty_label_map(self):
        empty = numpy.zeros_like(self.phantom.moving_labels_array)
        path = save(empty, MOVING_AFFINE, self.phantom.folder / "empty.nii.gz")
        self.assert_refused(self.phantom.register(moving_labels=path), INPUT, "empty.nii.gz")

    def test_fractional_labels(self):
        array = self.phantom.moving_labels_array.astype(numpy.float32)
        array[array == 2] = 1.5
        path = save(array, MOVING_AFFINE, self.phantom.folder / "half.nii.gz")
        self.assert_refused(self.phantom.register(moving_labels=path), INPUT, "half.nii.gz")

    def test_no_common_label(self):
        path = save(self.phantom.fixed_labels_array * 10, FIXED_AFFINE, self.phantom.folder / "ten.nii.gz")
        self.assert_refused(self.phantom.register(fixed_labels=path), INPUT, "share no label", "1, 2", "10, 20")

    def test_organs_far_apart_without_alignment(self):
        affine = FIXED_AFFINE.copy()
        affine[2, 3] += 200
        path = save(self.phantom.fixed_labels_array, affine, self.phantom.folder / "far.nii.gz")
        self.assert_refused(self.phantom.register("--no-align", fixed=None, fixed_labels=path), INPUT, "apart",
                            "--no-align")


class WrongTables(PhantomTest):
    def materials(self, text):
        path = self.phantom.folder / "materials.toml"
        path.write_text(text)
        return self.phantom.register("--materials", path)

    def test_label_without_material(self):
        result = self.materials("[label.1]\nyoungs_modulus_kpa = 3\npoissons_ratio = 0.45\n")
        self.assert_refused(result, INPUT, "label 2", "[label.2]", "materials.toml")

    def test_unknown_law(self):
        result = self.materials('[label.1]\nyoungs_modulus_kpa = 3\npoissons_ratio = 0.45\nlaw = "ogden"\n')
        self.assert_refused(result, INPUT, "ogden", "neo-hookean-lnj")

    def test_impossible_poissons_ratio(self):
        result = self.materials("[label.1]\nyoungs_modulus_kpa = 3\npoissons_ratio = 0.5\n")
        self.assert_refused(result, INPUT, "0.5", "line 1")

    def test_misspelt_material_key(self):
        result = self.materials("[label.1]\nyoungs_modulus = 3\npoissons_ratio = 0.45\n")
        self.assert_refused(result, INPUT, "line 2", "youngs_modulus_kpa")

    def test_unknown_config_key(self):
        path = self.phantom.folder / "config.toml"
        path.write_text("rounds = 3\nedge-lenght = 4.0\n")
        self.assert_refused(self.phantom.register("--config", path), INPUT, "line 2", "edge-lenght", "'edge-length'")

    def test_damaged_config(self):
        path = self.phantom.folder / "config.toml"
        path.write_text("rounds = 3\nedge-length = = 4\n")
        self.assert_refused(self.phantom.register("--config", path), INPUT, "line 2")

    def test_landmarks_with_a_word_in_place_of_a_number(self):
        path = self.phantom.folder / "landmarks.csv"
        path.write_text("pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n1,2,3,4,five,6\n")
        self.assert_refused(self.phantom.register("--landmarks", path), INPUT, "landmarks.csv", "2",
                            "(docs/manual/points.md)")

    def test_landmarks_in_ras(self):
        path = self.phantom.folder / "landmarks.csv"
        path.write_text("pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\n25,-10,14,24,-9,14\n24,-12,10,23,-11,10\n")
        self.assert_refused(self.phantom.register("--landmarks", path), INPUT, "2 of 2 moving landmarks", "LPS")


class WrongOptions(PhantomTest):
    def test_unknown_option(self):
        self.assert_refused(self.phantom.register("--edge-lenght", 5), INPUT, "--edge-lenght", "'--edge-length'")

    def test_unknown_verb(self):
        self.assert_refused(run("regsiter"), INPUT, "'register'")

    def test_missing_required_option(self):
        self.assert_refused(self.phantom.register(moving_labels=None), INPUT, "--moving-labels")

    def test_edge_length_below_zero(self):
        self.assert_refused(self.phantom.register("--edge-length", -1), INPUT, "--edge-length", "-1")

    def test_label_edge_length_without_a_label(self):
        self.assert_refused(self.phantom.register("--label-edge-length", "3.5"), INPUT, "3.5", "LABEL=MM")

    def test_landmarks_of_one_side(self):
        self.assert_refused(self.phantom.register("--landmarks-moving", "a.txt"), INPUT, "--landmarks-fixed")

    def test_unknown_device(self):
        self.assert_refused(self.phantom.register("--device", "tpu"), INPUT, "tpu", "gpu:<index>")

    def test_gpu_that_is_not_there(self):
        result = self.phantom.register("--device", "gpu:99", "--edge-length", 8)
        self.assert_refused(result, GPU)


class WrongOutput(PhantomTest):
    def test_output_is_a_file(self):
        path = self.phantom.folder / "taken"
        path.write_text("")
        self.assert_refused(self.phantom.register(output=path), IO, "taken")
        self.assert_refused(self.phantom.register(output=path / "below"), IO, "taken")

    def test_output_folder_that_cannot_be_made(self):
        self.assert_refused(self.phantom.register(output="/proc/tissuewarp"), IO, "/proc/tissuewarp")

    def mount(self, options):
        """A small file system of its own, where the machine permits one."""
        point = self.phantom.folder / "mounted"
        point.mkdir()
        try:
            mounted = subprocess.run(["mount", "-t", "tmpfs", "-o", options, "tmpfs", point], capture_output=True)
        except FileNotFoundError:
            self.skipTest("no mount command")
        if mounted.returncode != 0:
            self.skipTest("mounting is not permitted here")
        self.addCleanup(subprocess.run, ["umount", point], check=True)
        return point

    def test_read_only_folder(self):
        folder = self.phantom.folder / "read-only"
        folder.mkdir(mode=0o555)
        if os.access(folder, os.W_OK):
            folder.rmdir()
            folder = self.mount("size=1m,ro")
        self.assert_refused(self.phantom.register(output=folder), IO, str(folder))
        self.assertEqual(os.listdir(folder), [])
        self.assert_refused(self.phantom.register("--dry-run", output=folder), IO, str(folder))

    def test_full_disk(self):
        folder = self.mount("size=256k")
        result = self.phantom.register("--edge-length", 8, "--rounds", 1, output=folder / "deep" / "out")
        self.assert_refused(result, IO, str(folder / "deep" / "out"))
        self.assertEqual(os.listdir(folder), [])


if __name__ == "__main__":
    unittest.main()
