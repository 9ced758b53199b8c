#include "registration/surroundings/organ_slid.hpp"

#include "imaging/places.hpp"
#include "imaging/sampling.hpp"
#include "registration/field/sliding.hpp"
#include "registration/surroundings/window_fit.hpp"

namespace tissuewarp::registration::detail {

using imaging::Volume;

MotionsBeside motions_beside(const Deformation& deformation, double fade_mm) {
    const auto& mesh = deformation.mesh;
    const meshing::BoundarySurface boundary = meshing::boundary_surface(mesh);
    const auto continued = [&](const Eigen::Matrix3Xd& values) {
        return Continuation(mesh.nodes, mesh.tets, boundary, {values}, fade_mm, {}, sliding_options.continuation_mm);
    };
    return {continued(deformation.displacement),
            continued(motion_across_surface(mesh.nodes, boundary, deformation.displacement))};
}

bool organ_slid(const Deformation& deformation, const MotionsBeside& beside, const Outside& outside) {
    Volume weight(outside.grid, CV_32FC1), with(outside.grid, CV_32FC1), across(outside.grid, CV_32FC1);
    const imaging::LinearSampler intraoperative(outside.fixed);
    imaging::for_each_place(outside.grid, [&](const Eigen::Vector3d& X, std::int64_t n) {
        if (!(outside.weight.data<float>()[n] > 0)) return;
        const Eigen::Vector3d u = beside.with(X), v = beside.across(X);
        const Eigen::Vector3d one = deformation.placement * (X + u), other = deformation.placement * (X + v);
        with.data<float>()[n] = static_cast<float>(intraoperative.value(one));
        across.data<float>()[n] = static_cast<float>(intraoperative.value(other));
        const bool counts =
            (u - v).norm() > sliding_options.apart_mm && intraoperative.contains(one) && intraoperative.contains(other);
        weight.data<float>()[n] = counts ? 1.0F : 0.0F;
    });
    const double places = cv::sum(weight.voxels)[0];
    if (places * outside.grid.spacing.prod() < 1000 * sliding_options.least_cm3) return false;
    const WindowFit fit(outside.moving.voxels, weight, sliding_options.window_mm);
    const auto left = [&](const Volume& view) { return fit.of(view.voxels).residual.dot(weight.voxels); };
    return left(with) > sliding_options.gain * left(across);
}

}  // namespace tissuewarp::registration::detail
