#pragma once
/// Robust local affine motion of scattered matches.

#include "registration/matching/image_matching.hpp"

#include <Eigen/Core>

#include <vector>

namespace tissuewarp::registration::detail {

/// Chosen by hand; on which data is not recorded.
struct LocalAffineOptions {
    int concentration_steps = 4;                              ///< at most, of least trimmed squares
    double shift_stiffness = 1e-6, stretch_stiffness = 0.02;  ///< of the weights' sum: few or collinear neighbours do
                                                              ///< not extrapolate
};

/// Displacements at points, each known along some directions only.
struct ScatteredMotion {
    Eigen::Matrix3Xd points;               ///< LPS mm
    Eigen::Matrix3Xd displacements;        ///< mm
    std::vector<Eigen::Matrix3d> weights;  ///< positive semidefinite, largest eigenvalue at most 1
};

/// The nearest `count` others of each point, by distance and then by index.
std::vector<std::vector<int>> nearest_neighbours(const Eigen::Matrix3Xd& points, int count);
/// Of each of the columns `of`, among others of the columns `among`.
std::vector<std::vector<int>> nearest_neighbours(const Eigen::Matrix3Xd& points, const std::vector<int>& of,
                                                 const std::vector<int>& among, int count);

struct LocalMotion {
    Eigen::Vector3d displacement = Eigen::Vector3d::Zero();  ///< mm, at the point asked for
    double residual_mm = 0;                                  ///< median of the neighbours' residuals √(eᵀ W e)
};

/// Least trimmed squares fits of affine displacements about points (columns), each to its own neighbours, the point
/// itself not among them; of these a share of 0 to less than 1 is trimmed.
std::vector<LocalMotion> fit_local_affine(const ScatteredMotion& motion, const Eigen::Matrix3Xd& points,
                                          const std::vector<std::vector<int>>& neighbours, double trimmed_share);

/// Weight of a match among its neighbours: confidence times the information, scaled to its largest eigenvalue.
Eigen::Matrix3d neighbour_weight(const BlockMatch& match);

}  // namespace tissuewarp::registration::detail
