#pragma once
/// numpy arrays and what the libraries hold, without copies where the memory is the same.

#include "imaging/volume.hpp"

#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>

#include <Eigen/Core>

namespace tissuewarp::python {

namespace py = pybind11;

/// Points as numpy has them: (P, 3), LPS mm.
using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

/// A volume that shows the memory of a C-contiguous array [k, j, i] or, of vectors, [k, j, i, 3]; the array, and
/// `owner`, live as long as any copy of the volume. Throws InvalidInput for other types and shapes.
imaging::Volume volume_of(const py::array& array, const imaging::Geometry& grid, const py::object& owner);

/// A read-only array [k, j, i] or [k, j, i, 3] that shows the voxels and keeps them alive.
py::array array_of(const imaging::Volume& volume);

/// A (columns, rows) array that takes over a matrix of columns.
template <class Matrix>
py::array transposed(Matrix matrix) {
    using Scalar = typename Matrix::Scalar;
    auto* kept = new Matrix(std::move(matrix));
    const py::capsule owner(kept, [](void* p) { delete static_cast<Matrix*>(p); });
    return py::array_t<Scalar>({kept->cols(), kept->rows()}, kept->data(), owner);
}

/// The same of memory that `owner` keeps, read-only.
template <class Matrix>
py::array transposed_view(const Matrix& matrix, const py::object& owner) {
    py::array_t<typename Matrix::Scalar> view({matrix.cols(), matrix.rows()}, matrix.data(), owner);
    view.attr("flags").attr("writeable") = false;
    return view;
}

}  // namespace tissuewarp::python
