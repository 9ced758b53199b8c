#pragma once
/// What a body's displacement is with quadratic tetrahedra, whose error is orders below that of the settings under
/// study, and how well it is known.

#include "study/body.hpp"

#include <Eigen/Core>

#include <filesystem>

namespace tissuewarp::study {

struct Reference {
    Eigen::Matrix3Xd displacement;  ///< at the samples, mm
    Eigen::Matrix3Xd coarser;       ///< of a mesh with 0.4 times the tetrahedra
    /// Distance between the two, root mean square and largest, mm: more than the error where refinement by a factor of
    /// 1.36 in length halves it, which quadratic tetrahedra do from order 2.3 on.
    double uncertainty_mm = 0, largest_uncertainty_mm = 0;
    int tetrahedra = 0;  ///< wanted
};

/// Newton's method in float64 with averages of the pressure (tled::QuadraticPressure::NodalAverage), which do not lock.
/// The linear law by central differences of 1/50 of the load. Throws SolverFailure, Cancelled.
Reference reference_of(const Body& body, const Physics& physics, int tetrahedra, Observer& observer);

/// The same for other physics from what it changes on the coarser mesh alone: errors of the mesh cancel in that
/// difference, and the uncertainty is that of `own`. Throws SolverFailure, Cancelled.
Reference changed_reference(const Body& body, const Physics& physics, const Reference& own, Observer& observer);

/// HDF5, complete or absent. Throw IoError, InvalidInput for a file of another format.
void write_reference(const Reference& reference, const std::filesystem::path& path);
Reference read_reference(const std::filesystem::path& path);

}  // namespace tissuewarp::study
