#include "registration/pose/turned_image.hpp"

#include "imaging/filters.hpp"
#include "imaging/sampling.hpp"
#include "meshing/search/point_tree.hpp"
#include "registration/pose/pose_space.hpp"

#include <tbb/parallel_for.h>
#include <nlopt.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using Eigen::Isometry3d;
using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using imaging::Volume;

constexpr TurnedImageOptions rules;

/// The images' own smoothing for voxels of a size, so that none between them are passed over.
Volume smoothed(const Volume& image, double spacing_mm) {
    return imaging::smooth(image, 0.5 * spacing_mm);
}

imaging::Geometry grid_over(const imaging::Geometry& image, double spacing_mm) {
    imaging::Geometry grid = image;
    grid.spacing.setConstant(spacing_mm);
    for (std::size_t axis = 0; axis < 3; ++axis) {
        const double length = image.size[axis] * image.spacing[static_cast<Eigen::Index>(axis)];
        grid.size[axis] = std::max(2, static_cast<int>(std::ceil(length / spacing_mm)));
    }
    return grid;
}

/// Places in and about the organ on a lattice, and what the moving image shows there.
struct Samples {
    Matrix3Xd places;
    std::vector<float> values;

    Samples(const Volume& moving, const Matrix3Xd& nodes, double spacing_mm, int most) {
        const meshing::PointTree organ(nodes);
        const imaging::LinearSampler sampler(smoothed(moving, spacing_mm));
        const Eigen::Array3d lower = nodes.rowwise().minCoeff().array() - rules.beyond_mm,
                             upper = nodes.rowwise().maxCoeff().array() + rules.beyond_mm;
        std::vector<Vector3d> found;
        for (double z = lower[2]; z < upper[2]; z += spacing_mm)
            for (double y = lower[1]; y < upper[1]; y += spacing_mm)
                for (double x = lower[0]; x < upper[0]; x += spacing_mm)
                    if (const Vector3d at(x, y, z); sampler.contains(at) && organ.any_within(at, rules.beyond_mm))
                        found.push_back(at);
        const std::size_t stride = std::max<std::size_t>(1, found.size() / static_cast<std::size_t>(most));
        places.resize(3, static_cast<Eigen::Index>((found.size() + stride - 1) / stride));
        for (Eigen::Index n = 0; n < places.cols(); ++n) {
            places.col(n) = found[static_cast<std::size_t>(n) * stride];
            values.push_back(static_cast<float>(sampler.value(places.col(n))));
        }
    }
};

/// 1 − r² v of pairs of values.
class Correlation {
public:
    void add(float a, float b) {
        ++count_;
        sum_a_ += a;
        sum_b_ += b;
        aa_ += double(a) * a;
        bb_ += double(b) * b;
        ab_ += double(a) * b;
    }

    [[nodiscard]] double cost(std::size_t samples) const {
        const double in_view = double(count_) / double(std::max<std::size_t>(1, samples));
        const double a = count_ * aa_ - sum_a_ * sum_a_, b = count_ * bb_ - sum_b_ * sum_b_,
                     both = count_ * ab_ - sum_a_ * sum_b_;
        if (in_view < rules.least_in_view || !(a > 0) || !(b > 0)) return 1;
        return 1 - in_view * both * both / (a * b);
    }

private:
    double count_ = 0, sum_a_ = 0, sum_b_ = 0, aa_ = 0, bb_ = 0, ab_ = 0;
};

/// The fixed image on a coarse grid.
class FixedGrid {
public:
    FixedGrid(const Volume& fixed, const Volume& seen, double spacing_mm) {
        const imaging::Geometry grid = grid_over(fixed.geometry, spacing_mm);
        values_ = imaging::resample(smoothed(fixed, spacing_mm), grid, imaging::Interpolation::Linear);
        seen_ = imaging::resample(seen, grid, imaging::Interpolation::Nearest);
    }

    [[nodiscard]] const imaging::Geometry& geometry() const { return values_.geometry; }

    /// Of samples at whole steps from one voxel.
    [[nodiscard]] double cost(const std::vector<std::array<int, 3>>& steps, const std::vector<float>& values,
                              const std::array<int, 3>& from) const {
        const auto& size = geometry().size;
        const auto* shown = seen_.data<std::uint8_t>();
        const auto* value = values_.data<float>();
        Correlation correlation;
        for (std::size_t n = 0; n < steps.size(); ++n) {
            const int i = from[0] + steps[n][0], j = from[1] + steps[n][1], k = from[2] + steps[n][2];
            if (i < 0 || j < 0 || k < 0 || i >= size[0] || j >= size[1] || k >= size[2]) continue;
            const std::int64_t at = values_.offset(i, j, k);
            if (shown[at]) correlation.add(values[n], value[at]);
        }
        return correlation.cost(steps.size());
    }

private:
    Volume values_, seen_;
};

/// The 24 rotations that turn a cube into itself, and those around each.
std::vector<Eigen::Matrix3d> rotations() {
    std::vector<Eigen::Matrix3d> result;
    for (const Eigen::Matrix3d& symmetry : symmetries_of_a_cube())
        if (symmetry.determinant() > 0)
            for (const Eigen::Matrix3d& around : start_rotations(rules.start_rotation_deg))
                result.push_back(around * symmetry);
    return result;
}

/// The best shift of a rotation about the samples' middle.
FoundPose best_shift(const Eigen::Matrix3d& rotation, const Samples& samples, const FixedGrid& fixed) {
    const imaging::Geometry& grid = fixed.geometry();
    const Vector3d middle = samples.places.rowwise().mean();
    const Eigen::Matrix3d to_steps = grid.point_to_index() * rotation;
    std::vector<std::array<int, 3>> steps;
    for (Eigen::Index n = 0; n < samples.places.cols(); ++n) {
        const Vector3d step = to_steps * (samples.places.col(n) - middle);
        steps.push_back({int(std::lround(step[0])), int(std::lround(step[1])), int(std::lround(step[2]))});
    }
    FoundPose best;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i) {
                const double cost = fixed.cost(steps, samples.values, {i, j, k});
                if (cost >= best.cost) continue;
                best.cost = cost;
                best.placement.linear() = rotation;
                best.placement.translation() = grid.point(Vector3d(i, j, k)) - rotation * middle;
            }
    return best;
}

/// Of samples at a placement, between the fixed image's voxels.
double cost_of(const Isometry3d& placement, const Samples& samples, const imaging::LinearSampler& fixed,
               const Volume& seen) {
    const auto shown = [&](const Vector3d& at) {
        const Vector3d index = fixed.index(at);
        std::array<int, 3> voxel{};
        for (std::size_t a = 0; a < 3; ++a)
            voxel[a] = std::clamp(static_cast<int>(std::lround(index[static_cast<Eigen::Index>(a)])), 0,
                                  seen.geometry.size[a] - 1);
        return seen.data<std::uint8_t>()[seen.offset(voxel[0], voxel[1], voxel[2])] != 0;
    };
    Correlation correlation;
    for (Eigen::Index n = 0; n < samples.places.cols(); ++n) {
        const Vector3d at = placement * samples.places.col(n);
        if (fixed.contains(at) && shown(at))
            correlation.add(samples.values[static_cast<std::size_t>(n)], static_cast<float>(fixed.value(at)));
    }
    return correlation.cost(samples.values.size());
}

/// By BOBYQA, in motions about the middle of the placed samples.
FoundPose made_finer(const FoundPose& pose, const Samples& samples, const imaging::LinearSampler& fixed,
                     const Volume& seen) {
    const Matrix3Xd placed = pose.placement * samples.places;
    const Vector3d middle = placed.rowwise().mean();
    const PoseSpace space{middle, std::sqrt((placed.colwise() - middle).colwise().squaredNorm().mean())};
    using Cost = std::function<double(const double*)>;
    Cost cost = [&](const double* x) { return cost_of(space.rigid(x) * pose.placement, samples, fixed, seen); };
    nlopt::opt search(nlopt::LN_BOBYQA, 6);
    search.set_min_objective(
        [](unsigned, const double* x, double*, void* data) { return (*static_cast<const Cost*>(data))(x); }, &cost);
    search.set_initial_step(rules.first_step_mm);
    search.set_xtol_abs(rules.tolerance_mm);
    search.set_maxeval(rules.evaluations);
    std::vector<double> x(6, 0.0);
    double least = 0;
    try {
        search.optimize(x, least);
    } catch (const nlopt::roundoff_limited&) {
        // The best point so far is in x.
    }
    return {space.rigid(x.data()) * pose.placement, cost(x.data())};
}

}  // namespace

std::vector<FoundPose> turned_poses(const Volume& moving, const Matrix3Xd& nodes, const Volume& fixed,
                                    const Volume& seen, Observer& observer) {
    const auto is_flat = [](const Volume& image) {
        return *std::min_element(image.geometry.size.begin(), image.geometry.size.end()) < 2;
    };
    if (is_flat(moving) || is_flat(fixed)) return {};
    const std::vector<Eigen::Matrix3d> turns = rotations();
    std::vector<FoundPose> poses(turns.size());
    {
        const Samples samples(moving, nodes, rules.coarse_mm, rules.coarse_samples);
        if (samples.values.empty()) return {};
        const FixedGrid grid(fixed, seen, rules.coarse_mm);
        tbb::parallel_for(std::size_t{0}, turns.size(),
                          [&](std::size_t n) { poses[n] = best_shift(turns[n], samples, grid); });
    }
    observer.checkpoint("rigid alignment", 0.5);
    poses = distinct_poses(std::move(poses), nodes, rules.finalists);
    poses.emplace_back();  // as the headers say
    const Samples samples(moving, nodes, rules.fine_mm, rules.fine_samples);
    const imaging::LinearSampler sampler(smoothed(fixed, rules.fine_mm));
    const double by_headers = cost_of(Isometry3d::Identity(), samples, sampler, seen);
    tbb::parallel_for(std::size_t{0}, poses.size(),
                      [&](std::size_t n) { poses[n] = made_finer(poses[n], samples, sampler, seen); });
    observer.checkpoint("rigid alignment", 0.9);
    poses = distinct_poses(std::move(poses), nodes, rules.most);
    std::erase_if(poses, [&](const FoundPose& pose) { return pose.cost >= by_headers; });
    return poses;
}

}  // namespace tissuewarp::registration::detail
