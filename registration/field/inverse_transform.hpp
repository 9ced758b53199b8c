#pragma once
/// Where points seen during the operation were before it.

#include "registration/field.hpp"

#include <memory>

namespace tissuewarp::registration {

/// The inverse of PointTransform. Within the deformed mesh exact but for rounding, of the lowest element that holds the
/// point; outside found by steps of damped fixed-point iteration to 1e-5 mm.
class InversePointTransform {
public:
    explicit InversePointTransform(const Deformation& deformation, const FieldOptions& options = {});
    ~InversePointTransform();
    InversePointTransform(InversePointTransform&&) noexcept;
    InversePointTransform& operator=(InversePointTransform&&) noexcept;

    /// X for points y of the fixed frame, 3 × P, LPS mm; NaN where no X was found, as where the field folds. Throws
    /// InvalidInput for coordinates that are not finite.
    [[nodiscard]] Eigen::Matrix3Xd operator()(const Eigen::Matrix3Xd& points) const;

private:
    struct Impl;
    std::unique_ptr<Impl> impl_;
};

}  // namespace tissuewarp::registration
