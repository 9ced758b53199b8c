#include "study/phantom.hpp"

#include "core/errors.hpp"
#include "study/detail/organ_shape.hpp"
#include "study/detail/phantom_data.hpp"
#include "study/detail/quadratic_map.hpp"
#include "study/detail/random.hpp"
#include "study/detail/random_loads.hpp"
#include "study/detail/random_tissue.hpp"
#include "study/detail/truth.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace tissuewarp::study {

using Eigen::Vector3d;

namespace {

constexpr int attempts = 10;

void require_between(const char* what, double value, double low, double high) {
    if (!(value >= low && value <= high))
        throw InvalidInput(std::string("phantom: ") + what + " is " + std::to_string(value) + "; it must be between " +
                           std::to_string(low) + " and " + std::to_string(high));
}

void require_valid(const PhantomOptions& options) {
    require_between("the voxel in mm", options.voxel_mm, 0.5, 5);
    require_between("the deviation of boundaries in mm", options.boundary_deviation_mm, 0, 3);
    require_between("the deviation of points in mm", options.point_deviation_mm, 0.01, 5);
    require_between("the number of targets", options.targets, 1, 100000);
}

Eigen::Isometry3d random_motion(const Vector3d& centre, detail::Random& random) {
    constexpr double most_deg = 10, most_mm = 10;
    const double angle = random.uniform(0, most_deg) * EIGEN_PI / 180;
    const Vector3d axis = random.direction(), shift = random.uniform(0, most_mm) * random.direction();
    Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
    motion.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
    motion.translation() = centre + shift - motion.linear() * centre;
    return motion;
}

/// Seeds of the parts of a phantom, far apart however close the phantoms' are (SplitMix64, Steele 2014).
std::uint64_t derived(std::uint64_t seed, std::uint64_t part) {
    std::uint64_t z = seed + (part + 1) * 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebULL;
    return z ^ (z >> 31);
}

std::string told(const detail::RandomOrgan& organ, const detail::Truth& truth, double seen_share, int pairs) {
    const auto& [shape, tissue, loads] = organ;
    const auto length = truth.displacement.colwise().norm();
    char text[400];
    std::snprintf(
        text, sizeof text,
        "%s-like, %.0f mm; %s, %.1f kPa, Poisson's ratio %.3f, inclusion of %.0f mm %.1f times as stiff; moved by%s: "
        "mean %.1f, largest %.1f mm, least J %.2f; %.0f %% of the surface and %d places seen",
        shape.kind().c_str(), shape.length(), tissue.law.c_str(), tissue.youngs_modulus_kpa, tissue.poisson_ratio,
        shape.inclusion_radius(), tissue.stiffness_ratio, loads.words.c_str(), length.mean(), length.maxCoeff(),
        truth.min_jacobian, 100 * seen_share, pairs);
    return text;
}

Phantom drawn_phantom(std::uint64_t seed, const PhantomOptions& options, Observer& observer) {
    constexpr int least_elements = 2500, most_elements = 4000;
    constexpr double strain = 0.12;  // largest motion over the organ's length, at most
    detail::Random random(seed);
    detail::RandomOrgan organ = detail::random_organ(random);
    const detail::OrganShape& shape = organ.shape;
    const double motion_mm = random.uniform(3, std::min(15.0, strain * shape.length()));
    const int elements = least_elements + random.index(most_elements - least_elements);
    const Eigen::Isometry3d placement = random_motion(shape.centre(), random);
    const double seen_share = random.uniform(0.25, 0.5);
    const int pairs = 4 + random.index(7);

    observer.checkpoint("Truth", 0);
    detail::TruthMesh mesh = detail::truth_mesh(shape, elements, observer);
    organ.loads = detail::sized_loads(organ, mesh, motion_mm);
    const detail::Truth truth = detail::equilibrium(organ, std::move(mesh), observer);
    const detail::QuadraticMap deform(truth.mesh.quadratic, truth.displacement);
    const auto map = [&](const Vector3d& point) -> std::optional<Vector3d> {
        const auto moved = deform(point);
        if (!moved) return std::nullopt;
        return Vector3d(placement * *moved);
    };
    const detail::DeformedOrgan deformed{truth.mesh, placement * (truth.mesh.quadratic.nodes + truth.displacement)};

    observer.checkpoint("Drawing", 0.8);
    Phantom phantom;
    phantom.moving_labels = detail::draw(shape, options.voxel_mm);
    phantom.fixed_labels = detail::drawn_labels(deformed, options.voxel_mm, options.boundary_deviation_mm, random);
    phantom.surface = detail::seen_surface(deformed, seen_share, options.point_deviation_mm, random);
    constexpr double pair_depth_mm = 3, target_depth_mm = 1;
    phantom.points = detail::found_again(detail::places(shape, map, pairs, pair_depth_mm, random),
                                         options.point_deviation_mm, random);
    phantom.targets = detail::places(shape, map, options.targets, target_depth_mm, random);
    phantom.story = told(organ, truth, seen_share, pairs);
    return phantom;
}

}  // namespace

Phantom random_phantom(std::uint64_t seed, const PhantomOptions& options, Observer& observer) {
    require_valid(options);
    std::string failures;
    for (int attempt = 0; attempt < attempts; ++attempt) {
        try {
            Phantom phantom = drawn_phantom(derived(seed, std::uint64_t(attempt)), options, observer);
            phantom.seed = seed;
            if (attempt > 0)
                phantom.story += "; draw " + std::to_string(attempt + 1) + " of its seed, after: " + failures;
            return phantom;
        } catch (const SolverFailure& failure) {
            failures += (failures.empty() ? "" : "; ") + std::string(failure.what());
        } catch (const InvalidInput& refused) {  // an element with curved edges turned inside out at rest
            failures += (failures.empty() ? "" : "; ") + std::string(refused.what());
        }
    }
    throw SolverFailure("phantom " + std::to_string(seed) + " has no truth in " + std::to_string(attempts) +
                        " draws: " + failures);
}

}  // namespace tissuewarp::study
