"""Images of numpy, nibabel, SimpleITK and ITK lie where they lay, without copies where there need be none."""

import gc
import os
import sys
import tempfile
import types
import unittest
import unittest.mock
import weakref

import nibabel
import numpy
import tissuewarp

AFFINE = numpy.array([[-1.2, 0.1, 0, 30], [0.1, 1.1, 0, -20], [0, 0, 1.3, -10], [0, 0, 0, 1]])  # voxel -> RAS mm
AFFINE[:3, :2] = numpy.linalg.qr(AFFINE[:3, :2])[0] * [1.2, 1.1]


def array(dtype=numpy.int16, shape=(4, 5, 6)):
    return numpy.arange(numpy.prod(shape)).astype(dtype).reshape(shape)


class FakeSimpleItk:
    """What SimpleITK's images offer: it is not in Debian 12."""

    def __init__(self, voxels):
        self.voxels = voxels

    def GetSpacing(self):
        return (1.0, 2.0, 3.0)

    def GetOrigin(self):
        return (10.0, 20.0, 30.0)

    def GetDirection(self):
        return (0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)


def fake_module():
    module = types.ModuleType("SimpleITK")
    module.GetArrayViewFromImage = lambda image: image.voxels
    FakeSimpleItk.__module__ = "SimpleITK.SimpleITK"
    return module


class Images(unittest.TestCase):
    def test_arrays_are_shown_not_copied(self):
        for dtype in ("u1", "i1", "u2", "i2", "i4", "f4", "f8"):
            voxels = array(dtype)
            image = tissuewarp.Image(voxels)
            self.assertTrue(numpy.shares_memory(image.array, voxels), dtype)
            numpy.testing.assert_array_equal(image.array, voxels)
            self.assertEqual(image.array.dtype, voxels.dtype)
            self.assertFalse(image.array.flags.writeable)

    def test_arrays_live_as_long_as_images_and_their_views(self):
        voxels = array().copy()
        alive = weakref.ref(voxels)
        view = tissuewarp.Image(voxels).array
        del voxels
        gc.collect()
        self.assertIsNotNone(alive())
        numpy.testing.assert_array_equal(view, array())
        del view
        gc.collect()
        self.assertIsNone(alive())

    def test_other_types_become_ones_that_are_stored(self):
        for given, stored in ((bool, "u1"), ("i8", "i4"), ("u4", "i4"), ("f2", "f4"), (">i2", "i2"), (">f8", "f8")):
            image = tissuewarp.Image(array(given))
            self.assertEqual(image.array.dtype, numpy.dtype(stored))
            numpy.testing.assert_array_equal(image.array, array(given))
        self.assertEqual(tissuewarp.Image(array("i8") + 2**40).array.dtype, numpy.float64)
        turned = numpy.asfortranarray(array())
        numpy.testing.assert_array_equal(tissuewarp.Image(turned).array, array())

    def test_what_is_no_image_is_refused(self):
        for bad in (array(shape=(4, 5)), array(shape=(4, 5, 6, 2)), array(complex), array("U4")):
            with self.assertRaises(tissuewarp.InvalidInput):
                tissuewarp.Image(bad)
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "spacing"):
            tissuewarp.Image(array(), spacing=(1, 0, 1))
        with self.assertRaises(tissuewarp.InvalidInput):
            tissuewarp.Image(array(), direction=numpy.ones((3, 3)))
        with self.assertRaisesRegex(TypeError, "ndarray has no geometry"):
            tissuewarp.as_image(array())
        with self.assertRaises(tissuewarp.InvalidInput):
            tissuewarp.Image.from_affine(array(), numpy.zeros((4, 4)))

    def test_nibabel_there_and_back(self):
        voxels = numpy.asfortranarray(array(shape=(6, 5, 4)))
        given = nibabel.Nifti1Image(voxels, AFFINE)
        image = tissuewarp.as_image(given)
        self.assertTrue(numpy.shares_memory(image.array, voxels))
        self.assertEqual(image.array[3, 2, 1], voxels[1, 2, 3])
        lps = image.origin + image.direction @ (image.spacing * [1, 2, 3])
        numpy.testing.assert_allclose(lps * [-1, -1, 1], (AFFINE @ [1, 2, 3, 1])[:3], atol=1e-12)
        back = image.to_nibabel()
        numpy.testing.assert_allclose(back.affine, AFFINE, atol=1e-12)
        numpy.testing.assert_array_equal(numpy.asarray(back.dataobj), voxels)

    def test_files_say_the_same_as_nibabel(self):
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "image.nii.gz")
            image = nibabel.Nifti1Image(array(shape=(6, 5, 4)), AFFINE)
            image.header.set_xyzt_units("mm")
            nibabel.save(image, path)
            read, given = tissuewarp.read_image(path), tissuewarp.as_image(nibabel.load(path))
            numpy.testing.assert_array_equal(read.array, given.array)
            numpy.testing.assert_allclose(read.affine, given.affine, atol=1e-5)
            self.assertEqual(tissuewarp.read_labels(path).array.dtype, numpy.int32)
            again = os.path.join(folder, "again.nrrd")
            read.write(again)
            numpy.testing.assert_array_equal(tissuewarp.read_image(again).array, read.array)
            with self.assertRaisesRegex(tissuewarp.IoError, "missing.nii"):
                tissuewarp.read_image(os.path.join(folder, "missing.nii"))
        self.assertTrue(issubclass(tissuewarp.IoError, OSError))

    def test_simpleitk_is_asked_for_its_view(self):
        with unittest.mock.patch.dict(sys.modules, SimpleITK=fake_module()):
            given = FakeSimpleItk(array())
            image = tissuewarp.as_image(given)
        self.assertTrue(numpy.shares_memory(image.array, given.voxels))
        numpy.testing.assert_array_equal(image.spacing, [1, 2, 3])
        numpy.testing.assert_array_equal(image.origin, [10, 20, 30])
        numpy.testing.assert_array_equal(image.direction, [[0, -1, 0], [1, 0, 0], [0, 0, 1]])

    def test_itk_images_are_arrays_themselves(self):
        class ItkImage(FakeSimpleItk):
            def __array__(self, dtype=None):
                return self.voxels

            def GetDirection(self):
                return numpy.eye(3)

        image = tissuewarp.as_image(ItkImage(array()))
        numpy.testing.assert_array_equal(image.array, array())
        ItkImage.GetDirection = lambda self: numpy.eye(2)
        with self.assertRaisesRegex(tissuewarp.InvalidInput, "2 dimensions"):
            tissuewarp.as_image(ItkImage(array()))

    def test_images_for_simpleitk(self):
        made = unittest.mock.MagicMock()
        with unittest.mock.patch.dict(sys.modules, SimpleITK=made):
            result = tissuewarp.Image(array(), (1, 2, 3), (4, 5, 6)).to_simpleitk()
        numpy.testing.assert_array_equal(made.GetImageFromArray.call_args.args[0], array())
        result.SetSpacing.assert_called_with([1, 2, 3])
        result.SetOrigin.assert_called_with([4, 5, 6])
        result.SetDirection.assert_called_with(numpy.eye(3).ravel().tolist())


if __name__ == "__main__":
    unittest.main()
