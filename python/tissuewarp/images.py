"""Images with their place in the patient, from numpy arrays and from objects of nibabel, SimpleITK and ITK.

Inside, lengths are mm and directions LPS (left, posterior, superior), as in ITK. nibabel's affines are RAS; they are
turned on the way in and out.
"""

import os
import sys

import numpy

from . import _core
from .errors import InvalidInput

_LPS_OF_RAS = numpy.diag([-1.0, -1.0, 1.0, 1.0])


class Image:
    """Voxels with their place in the patient: the geometry of ITK.

    array      (z, y, x), or (z, y, x, 3) for vectors in mm, as SimpleITK's GetArrayFromImage gives it: x runs fastest.
               C-contiguous arrays of uint8, int8, uint16, int16, int32, float32 and float64 are shown, not copied: do
               not change them while an image shows them. Others are copied.
    spacing    (x, y, z), mm
    origin     (x, y, z), LPS mm: centre of voxel [0, 0, 0]
    direction  (3, 3): its columns are the unit axes x, y, z in LPS

    Raises InvalidInput for voxel types and geometries that cannot be used.
    """

    __slots__ = ("_volume",)

    def __init__(self, array, spacing=(1.0, 1.0, 1.0), origin=(0.0, 0.0, 0.0), direction=None):
        self._volume = _volume(array, spacing, origin, numpy.eye(3) if direction is None else direction)

    @classmethod
    def from_affine(cls, array, affine):
        """Of an array (x, y, z) with a (4, 4) affine from voxels to RAS mm, as nibabel has them.

        Arrays in Fortran's order, as nibabel reads them, are shown, not copied.
        """
        array = numpy.asanyarray(array)
        if array.ndim != 3:
            raise InvalidInput(f"with an affine the shape is (x, y, z); this array has the shape {array.shape}")
        return cls._of(_volume(array.T, *_geometry_of_affine(affine)))

    @classmethod
    def _of(cls, volume):
        image = cls.__new__(cls)
        image._volume = volume
        return image

    @property
    def array(self) -> numpy.ndarray:
        """The voxels, (z, y, x) or (z, y, x, 3): a read-only view. Copy it to change it."""
        return self._volume.array

    @property
    def spacing(self) -> numpy.ndarray:
        """(x, y, z), mm."""
        return self._volume.geometry.spacing

    @property
    def origin(self) -> numpy.ndarray:
        """(x, y, z), LPS mm: centre of voxel [0, 0, 0]."""
        return self._volume.geometry.origin

    @property
    def direction(self) -> numpy.ndarray:
        """(3, 3): columns are the unit axes x, y, z in LPS."""
        return self._volume.geometry.direction

    @property
    def affine(self) -> numpy.ndarray:
        """(4, 4), from voxel (x, y, z) to RAS mm, as nibabel has it."""
        matrix = numpy.eye(4)
        matrix[:3, :3] = self._volume.geometry.index_to_point()
        matrix[:3, 3] = self.origin
        return _LPS_OF_RAS @ matrix

    def to_nibabel(self):
        """A nibabel.Nifti1Image that shows the same voxels, (x, y, z) or, of vectors, (x, y, z, 1, 3) in LPS mm."""
        import nibabel

        array = self.array
        if array.ndim == 4:
            image = nibabel.Nifti1Image(array.transpose(2, 1, 0, 3)[:, :, :, None, :], self.affine)
            image.header.set_intent("vector")
        else:
            image = nibabel.Nifti1Image(array.T, self.affine)
        image.header.set_xyzt_units("mm")
        return image

    def to_simpleitk(self):
        """A SimpleITK.Image of the same voxels (a copy)."""
        import SimpleITK

        image = SimpleITK.GetImageFromArray(self.array, isVector=self.array.ndim == 4)
        image.SetSpacing(self.spacing.tolist())
        image.SetOrigin(self.origin.tolist())
        image.SetDirection(self.direction.ravel().tolist())
        return image

    def write(self, path) -> None:
        """Writes .nii, .nii.gz, .nrrd, .mha, …; vectors as displacement fields. Raises IoError."""
        _core.write_volume(self._volume, os.fspath(path))

    def __repr__(self):
        size = " × ".join(map(str, self._volume.geometry.size))
        return f"<tissuewarp.Image {size} {self.array.dtype}, spacing {self.spacing.tolist()} mm>"


def read_image(path) -> Image:
    """Reads a file or a DICOM folder (the manual, images). Raises IoError, InvalidInput."""
    return _read(_core.read_volume, path)


def read_labels(path) -> Image:
    """The same of a label map: int32. Raises IoError, InvalidInput."""
    return _read(_core.read_labels, path)


def _read(read, path):
    import logging

    volume, notes = read(os.fspath(path))
    for note in notes:
        logging.getLogger("tissuewarp").info("%s", note)
    return Image._of(volume)


def as_image(image) -> Image:
    """The Image that an object stands for: itself, or one of nibabel (`affine`, `dataobj`), SimpleITK or ITK
    (`GetSpacing`, `GetOrigin`, `GetDirection`). A bare array is refused: it has no place in the patient.
    """
    if isinstance(image, Image):
        return image
    if hasattr(image, "GetSpacing") and hasattr(image, "GetDirection"):
        return _of_itk(image)
    if hasattr(image, "affine") and hasattr(image, "dataobj"):
        return Image.from_affine(numpy.asanyarray(image.dataobj), image.affine)
    raise TypeError(
        f"{type(image).__name__} has no geometry; give tissuewarp.Image(array, spacing, origin, direction), "
        "tissuewarp.Image.from_affine(array, affine), or an image of nibabel, SimpleITK or ITK"
    )


def _of_itk(image):
    # SimpleITK shows its voxels through a function of its module; ITK's images are arrays themselves.
    view = getattr(sys.modules.get(type(image).__module__.split(".")[0]), "GetArrayViewFromImage", numpy.asarray)
    direction = numpy.array(image.GetDirection(), dtype=float).reshape(-1)
    if direction.size != 9:
        raise InvalidInput(f"an image of {round(direction.size ** 0.5)} dimensions; give one of three")
    geometry = (tuple(image.GetSpacing()), tuple(image.GetOrigin()), direction.reshape(3, 3))
    return Image._of(_volume(view(image), *geometry, owner=image))


def _volume(array, spacing, origin, direction, owner=None):
    return _core.Volume(_storable(numpy.asanyarray(array)), origin=origin, spacing=spacing, direction=direction,
                        owner=owner)


def _storable(array):
    """The array itself where its memory can be shown, otherwise a copy of a type that can."""
    if array.dtype == bool:
        array = array.view(numpy.uint8)
    elif array.dtype == numpy.float16:
        array = array.astype(numpy.float32)
    elif array.dtype.kind in "iu" and (array.dtype.itemsize == 8 or array.dtype == numpy.uint32):
        limits = numpy.iinfo(numpy.int32)
        fits = array.size == 0 or (array.min() >= limits.min and array.max() <= limits.max)
        array = array.astype(numpy.int32 if fits else numpy.float64)
    return numpy.ascontiguousarray(array, dtype=array.dtype.newbyteorder("="))


def _geometry_of_affine(affine):
    matrix = _LPS_OF_RAS @ numpy.asarray(affine, dtype=float)
    spacing = numpy.linalg.norm(matrix[:3, :3], axis=0)
    if not (numpy.isfinite(matrix).all() and (spacing > 0).all()):
        raise InvalidInput(f"affine {numpy.asarray(affine).tolist()}: voxels have no size; give one of rank three")
    return spacing, matrix[:3, 3], matrix[:3, :3] / spacing


def labels_volume(image, name):
    """int32 labels for the library; `name` stands for them in messages."""
    return _core.as_labels(as_image(image)._volume, name)


def geometry_of(image):
    return as_image(image)._volume.geometry
