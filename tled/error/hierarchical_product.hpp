#pragma once
/// The tangent stiffness of a HierarchicalTissue times a vector, eight elements at a time in float32: the slow twin is
/// QuadraticTetrahedra::stiffness.

#include "tled/error/hierarchical_tissue.hpp"

#include <Eigen/Core>

#include <array>
#include <memory>
#include <vector>

namespace tissuewarp::tled::detail {

class HierarchicalProduct {
public:
    /// Keeps references to space and rest state of the tissue.
    explicit HierarchicalProduct(const HierarchicalTissue& tissue);
    ~HierarchicalProduct();

    /// K x, 3 × size(), mN for mm; rounded as float32, the same bits for any number of threads. One call at a time.
    [[nodiscard]] Eigen::Matrix3Xd operator()(const Eigen::Matrix3Xd& x) const;

private:
    static constexpr int lanes = 8;
    using Lanes = Eigen::Array<float, lanes, 1>;
    using Local9 = std::array<Lanes, 9>;  // of ∂u/∂ξ and what it is multiplied by
    struct Batch;

    /// ∫ L_a ∂x/∂ξ / V for the four corners of the elements of a batch.
    static std::array<Local9, 4> moments(const Batch& batch, const Eigen::Matrix3Xd& x);
    void place_forces();
    /// M_a U'' times the rate of the averaged J along x, kPa.
    [[nodiscard]] Eigen::VectorXf pressure_rates(const Eigen::Matrix3Xd& x) const;

    const HierarchicalSpace& space_;
    const RestState& rest_;
    Eigen::VectorXd nodal_modulus_;
    bool any_averaged_ = false;
    std::vector<Batch> batches_;
    std::vector<int> force_offset_, force_place_;        // of corners and bubbles: the forces to add up
    mutable std::vector<std::array<Lanes, 30>> forces_;  // on corners and bubbles of every batch
};

}  // namespace tissuewarp::tled::detail
