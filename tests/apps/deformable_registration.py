"""Deformable Spatial Registration of DICOM as pydicom reads it."""

import numpy


def deformation_of(item):
    """Matrices before and after (4 x 4), the grid's item, its vectors (slices, rows, columns, 3) and its axes as columns, mm."""
    (grid,) = item.DeformableRegistrationGridSequence
    before, after = (numpy.array(sequence[0].FrameOfReferenceTransformationMatrix, float).reshape(4, 4) for sequence
                     in (item.PreDeformationMatrixRegistrationSequence, item.PostDeformationMatrixRegistrationSequence))
    size = list(grid.GridDimensions)
    vectors = numpy.frombuffer(grid.VectorGridData, "<f4").reshape(size[2], size[1], size[0], 3)
    row, column = numpy.reshape(numpy.array(grid.ImageOrientationPatient, float), (2, 3))
    axes = numpy.stack([row, column, numpy.cross(row, column)], axis=1) * grid.GridResolution
    return before, after, grid, vectors, axes
