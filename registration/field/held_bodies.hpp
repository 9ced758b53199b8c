#pragma once
/// Rigid bodies beside an organ, whose places a continued field does not choose.

#include "imaging/mask_lookup.hpp"
#include "registration/deformation.hpp"

#include <cstdint>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

class HeldBodies {
public:
    /// None.
    HeldBodies() : HeldBodies({}, {}) {}
    /// `mask`: uint8, 1 at rest, n ≥ 2 moved by motions[n − 2], 0 elsewhere.
    HeldBodies(const imaging::Volume& mask, std::vector<Eigen::Isometry3d> motions)
        : mask_(mask), lookup_(mask), motions_(std::move(motions)) {}

    [[nodiscard]] bool empty() const { return lookup_.empty(); }
    /// Of the boxes about the bodies that moved, 3 × 8 for each.
    [[nodiscard]] Eigen::Matrix3Xd corners_of_moved() const;
    /// 0 where there is none.
    [[nodiscard]] std::uint8_t at(const Eigen::Vector3d& point) const { return lookup_.value(point); }
    /// Of a point of a body, mm.
    [[nodiscard]] Eigen::Vector3d displacement(std::uint8_t body, const Eigen::Vector3d& point) const {
        if (body < 2) return Eigen::Vector3d::Zero();
        return motions_[std::size_t{body} - 2] * point - point;
    }

private:
    imaging::Volume mask_;
    imaging::MaskLookup lookup_;
    std::vector<Eigen::Isometry3d> motions_;
};

/// In the moving frame, with displacements before the motion of the surroundings (Deformation::far_motion).
HeldBodies held_before(const Deformation& deformation);
/// The same where they went, with displacements back.
HeldBodies held_after(const Deformation& deformation);

/// How bodies moved against the surroundings: F⁻¹ M of each, F the motion of these.
std::vector<Eigen::Isometry3d> against_surroundings(const Surroundings& surroundings);

/// The grid of a mask as above, that also holds where these motions take its bodies.
imaging::Geometry grown_by(const imaging::Volume& bodies, const std::vector<Eigen::Isometry3d>& motions);

}  // namespace tissuewarp::registration::detail
