#include "registration/field/inverse_transform.hpp"

#include "core/errors.hpp"
#include "meshing/point_location.hpp"

#include <tbb/parallel_for.h>

#include <limits>

namespace tissuewarp::registration {

namespace {

/// Chosen by hand: the continuation is gentle, and a field of it needs some ten steps.
struct InverseOptions {
    double exact_mm = 1e-5;  ///< of the residual
    int steps = 100;         ///< at most, halvings among them
};

}  // namespace

struct InversePointTransform::Impl {
    Deformation deformation;
    PointTransform forward;
    meshing::PointLocator deformed;

    Impl(const Deformation& given, const FieldOptions& options)
        : deformation(given.with_placement(given.far_motion())),
          forward(given, options),
          deformed(given.deformed_mesh()) {}

    /// X ← X + part · P⁻¹(y − φ(X)), the part halved where the residual would grow.
    [[nodiscard]] Eigen::Vector3d outside(const Eigen::Vector3d& y) const {
        constexpr InverseOptions limits;
        const auto residual = [&](const Eigen::Vector3d& X) -> Eigen::Vector3d {
            return deformation.placement.linear().transpose() * (y - forward(X).col(0));
        };
        Eigen::Vector3d X = deformation.placement.inverse() * y, wanted = residual(X);
        double part = 1;
        for (int step = 0; step < limits.steps; ++step) {
            if (wanted.norm() < limits.exact_mm) return X;
            const Eigen::Vector3d next = X + part * wanted, left = residual(next);
            if (left.norm() < wanted.norm()) {
                X = next;
                wanted = left;
                part = std::min(1.0, 2 * part);
            } else {
                part /= 2;
            }
        }
        return Eigen::Vector3d::Constant(std::numeric_limits<double>::quiet_NaN());
    }

    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& y) const {
        const auto found = deformed.find(y);
        if (!found) return outside(y);
        return deformation.mesh.nodes(Eigen::all, deformation.mesh.tets.col(found->tet)) * found->barycentric;
    }
};

InversePointTransform::InversePointTransform(const Deformation& deformation, const FieldOptions& options)
    : impl_(std::make_unique<Impl>(deformation, options)) {}
InversePointTransform::~InversePointTransform() = default;
InversePointTransform::InversePointTransform(InversePointTransform&&) noexcept = default;
InversePointTransform& InversePointTransform::operator=(InversePointTransform&&) noexcept = default;

Eigen::Matrix3Xd InversePointTransform::operator()(const Eigen::Matrix3Xd& points) const {
    if (!points.allFinite()) throw InvalidInput("inverse transform: a coordinate is not finite; remove that point");
    Eigen::Matrix3Xd mapped(3, points.cols());
    tbb::parallel_for(Eigen::Index{0}, points.cols(), [&](Eigen::Index p) { mapped.col(p) = (*impl_)(points.col(p)); });
    return mapped;
}

}  // namespace tissuewarp::registration
