"""Images and displacement fields in LPS mm, read without any code of the program's."""

import zlib

import nibabel
import numpy
from scipy import ndimage

RAS_TO_LPS = numpy.diag([-1.0, -1.0, 1.0, 1.0])
METAIMAGE_TYPES = {"MET_CHAR": "i1", "MET_UCHAR": "u1", "MET_SHORT": "<i2", "MET_USHORT": "<u2", "MET_INT": "<i4",
                   "MET_UINT": "<u4", "MET_FLOAT": "<f4", "MET_DOUBLE": "<f8"}


def read_metaimage(path):
    """Voxels x, y, z (, channel) of a .mha file and its affine from index to LPS. Little-endian files with their data inside."""
    data = path.read_bytes()
    header, at = {}, 0
    while "ElementDataFile" not in header:
        end = data.index(b"\n", at)
        key, _, value = data[at:end].decode("ascii").partition("=")
        header[key.strip()], at = value.strip(), end + 1
    if header["ElementDataFile"] != "LOCAL" or header.get("BinaryDataByteOrderMSB", "False") != "False":
        raise ValueError(f"{path}: only little-endian files that hold their own data are read")
    raw = zlib.decompress(data[at:]) if header.get("CompressedData") == "True" else data[at:]
    shape = [int(n) for n in header["DimSize"].split()]
    channels = int(header.get("ElementNumberOfChannels", 1))
    voxels = numpy.frombuffer(raw, METAIMAGE_TYPES[header["ElementType"]]).reshape(shape[::-1] + [channels])
    voxels = voxels.transpose(2, 1, 0, 3)
    affine = numpy.eye(4)
    # TransformMatrix lists the direction of the first axis, then of the second, then of the third.
    axes = numpy.array(header["TransformMatrix"].split(), float).reshape(3, 3).T
    affine[:3, :3] = axes * numpy.array(header["ElementSpacing"].split(), float)
    affine[:3, 3] = numpy.array(header["Offset"].split(), float)
    return (voxels[..., 0] if channels == 1 else voxels), affine


def read_image(path):
    """Voxels and the affine from index to LPS mm, of NIfTI or .mha."""
    if path.suffix == ".mha":
        return read_metaimage(path)
    image = nibabel.load(path)
    return numpy.asarray(image.dataobj), RAS_TO_LPS @ image.affine


def write_image(path, voxels, affine):
    """NIfTI of voxels whose `affine` maps index to LPS mm."""
    image = nibabel.Nifti1Image(voxels, RAS_TO_LPS @ affine)
    image.set_qform(image.affine, 1)
    nibabel.save(image, path)


def write_field(path, field, affine):
    """A displacement field x, y, z, 3 in LPS mm as NIfTI of intent 1007."""
    image = nibabel.Nifti1Image(field[:, :, :, None, :].astype(numpy.float32), RAS_TO_LPS @ affine)
    image.header.set_intent(1007)
    nibabel.save(image, path)


def read_field(path):
    """Displacement x, y, z, 3 in LPS mm and its affine from index to LPS mm."""
    voxels, affine = read_image(path)
    return numpy.asarray(voxels, numpy.float32).reshape(voxels.shape[:3] + (3,)), affine


def to_index(affine, points):
    return (points - affine[:3, 3]) @ numpy.linalg.inv(affine[:3, :3]).T


def to_points(affine, index):
    return index @ affine[:3, :3].T + affine[:3, 3]


def grid_points(shape, affine):
    """LPS points of all voxels, n x 3, the last axis fastest."""
    return to_points(affine, numpy.stack(numpy.meshgrid(*map(numpy.arange, shape), indexing="ij"), axis=-1).reshape(-1, 3))


def sample(field, affine, points):
    """Trilinear values of a field at LPS points, n x 3; beyond the grid the value of its nearest point."""
    index = to_index(affine, points).T
    return numpy.stack([ndimage.map_coordinates(field[..., c], index, output=float, order=1, mode="nearest")
                        for c in range(3)], axis=1)


def inside(mask, affine, points):
    """Whether all voxels around each LPS point belong to a mask."""
    return ndimage.map_coordinates((mask > 0).astype(numpy.float32), to_index(affine, points).T, order=1) > 0.999


def invert_at(field, affine, points, tolerance=0.01, iterations=200):
    """Where points x end under the inverse of y -> y + field(y): y of y + field(y) = x, and the residual left, mm.

    Fixed-point iteration y <- y + w (x - y - field(y)); a point whose residual grows takes its step back and halves its w,
    so that strong gradients converge too. Where the field folds there may be no solution: look at the residual.
    """
    target = numpy.asarray(points, float)
    place = target - sample(field, affine, target)
    missing = target - place - sample(field, affine, place)
    residual = numpy.linalg.norm(missing, axis=1)
    weight = numpy.ones(len(target))
    for _ in range(iterations):
        active = numpy.flatnonzero((residual > tolerance) & (weight > 1e-3))
        if not len(active):
            break
        trial = place[active] + weight[active, None] * missing[active]
        left = target[active] - trial - sample(field, affine, trial)
        size = numpy.linalg.norm(left, axis=1)
        better = size < residual[active]
        accepted = active[better]
        place[accepted], missing[accepted], residual[accepted] = trial[better], left[better], size[better]
        weight[accepted] = numpy.minimum(1.0, 1.5 * weight[accepted])
        weight[active[~better]] *= 0.5
    return place, residual


def jacobian_determinants(field, affine):
    """det of the gradient of y -> y + field(y) at every voxel, by central differences, one-sided on the grid's rim."""
    to_axis = numpy.linalg.inv(affine[:3, :3]).astype(numpy.float32)
    determinants = numpy.empty(field.shape[:3], numpy.float32)
    for first in range(0, field.shape[0], 16):  # slabs, because the gradient is nine times the grid
        begin, end = max(first - 1, 0), min(first + 17, field.shape[0])
        slopes = numpy.gradient(field[begin:end], axis=(0, 1, 2))
        f = [sum(slope * to_axis[i, axis] for i, slope in enumerate(slopes)) for axis in range(3)]
        for axis in range(3):
            f[axis][..., axis] += 1.0
        slab = (f[0] * numpy.cross(f[1], f[2])).sum(axis=-1)  # columns of the gradient of the map
        determinants[first:first + 16] = slab[first - begin:first - begin + 16]
    return determinants


def folded_share(field, affine, organ):
    """Shares of voxels with det J <= 0, inside an organ's mask on the field's grid and on the whole grid."""
    folded = jacobian_determinants(field, affine) <= 0.0
    return dict(organ=float(folded[organ].mean()) if organ.any() else 0.0, grid=float(folded.mean()))


def organ_mask(path, shape, affine):
    """The voxels of a grid that lie in a mask or label map, nearest neighbour; beyond the map there is no organ."""
    mask, own = read_image(path)
    both = numpy.linalg.inv(own) @ affine
    return ndimage.affine_transform((mask > 0).astype(numpy.uint8), both[:3, :3], both[:3, 3], shape, order=0) > 0


def finite(field):
    return bool(numpy.isfinite(field).all())
