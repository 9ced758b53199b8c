#pragma once
/// The cube problems of data/reference solved with a mesh of ours, and their reference values in mm and mN.

#include "tled/model.hpp"

#include <Eigen/Core>

#include <string>
#include <vector>

namespace tissuewarp::verification {

enum class Law { Iso, LnJ };

/// Reference values of one problem under one law.
struct CubeReference {
    std::string name;
    Eigen::Vector3d top_displacement = Eigen::Vector3d::Zero();  ///< mm
    tled::Material material;
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< exerted by the top platen, mN; NaN where not given
    Eigen::Vector3d force_uncertainty = Eigen::Vector3d::Zero();  ///< mN
    Eigen::Matrix3Xd points;                                      ///< rest positions, mm
    Eigen::Matrix3Xd displacement;                                ///< of the points, mm
    Eigen::Matrix3Xd displacement_uncertainty;                    ///< mm
    double energy = 0, energy_uncertainty = 0;                    ///< mN mm
};

/// `file` is the path of a JSON file of data/reference.
CubeReference cube_reference(const std::string& file, Law law);

/// The solution on a mesh of `cells` per edge.
struct CubeSolution {
    int cells = 0, iterations = 0;
    Eigen::Vector3d force = Eigen::Vector3d::Zero();  ///< exerted by the top platen, mN
    Eigen::Matrix3Xd displacement;                    ///< of the points, mm
    double energy = 0;                                ///< mN mm
    double min_jacobian = 0;
};

CubeSolution solve_cube(const CubeReference& reference, tled::Element element, int cells);

/// Richardson extrapolation of three values on meshes of constant refinement ratio, coarse to fine.
struct Extrapolation {
    double value = 0;
    double order = 0;  ///< NaN where the differences do not fall
};
Extrapolation richardson(double coarse, double middle, double fine, double ratio);

/// Largest distance between computed and reference points, mm, over the points at least `margin` (mm) from the bonded
/// faces, whose edges are singular.
double largest_point_error(const CubeReference& reference, const CubeSolution& solution, double margin = 20.0);

}  // namespace tissuewarp::verification
