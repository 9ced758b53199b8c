#include "study/phantom.hpp"

#include "core/errors.hpp"
#include "meshing/search/point_tree.hpp"
#include "study/detail/bent_map.hpp"
#include "study/detail/field_map.hpp"
#include "study/detail/label_organ.hpp"
#include "study/detail/organ_shape.hpp"
#include "study/detail/phantom_data.hpp"
#include "study/detail/phantom_image.hpp"
#include "study/detail/quadratic_map.hpp"
#include "study/detail/random.hpp"
#include "study/detail/random_loads.hpp"
#include "study/detail/random_tissue.hpp"
#include "study/detail/resected_organ.hpp"
#include "study/detail/truth.hpp"
#include "study/detail/ultrasound_phantom.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace tissuewarp::study {

using Eigen::Vector3d;

namespace {

constexpr int attempts = 10;

void require_between(const char* what, double value, double low, double high) {
    if (!(value >= low && value <= high))
        throw InvalidInput(std::string("phantom: ") + what + " is " + std::to_string(value) + "; it must be between " +
                           std::to_string(low) + " and " + std::to_string(high));
}

bool takes_organs(Family family) {
    return family == Family::Labelled || family == Family::Found;
}

void require_valid(const PhantomOptions& options) {
    require_between("the voxel in mm", options.voxel_mm, 0.5, 5);
    require_between("the deviation of boundaries in mm", options.boundary_deviation_mm, 0, 3);
    require_between("the deviation of points in mm", options.point_deviation_mm, 0.01, 5);
    require_between("the number of targets", options.targets, 1, 100000);
    if (options.misplacement) {
        require_between("the misplacement in degrees", options.misplacement->most_deg, 0, 180);
        require_between("the misplacement in mm", options.misplacement->most_mm, 0, 100);
    }
    if (takes_organs(options.family) && options.organs.voxels.empty())
        throw InvalidInput("phantom: give the label map whose organs are to be bent");
    if (options.family == Family::Found && options.fields.empty())
        throw InvalidInput("phantom: give the displacement fields that are to bend organs");
}

constexpr Misplacement solved_motion{10, 10}, bent_motion{20, 20};

Eigen::Isometry3d random_motion(const Vector3d& centre, const Misplacement& most, detail::Random& random) {
    const double angle = random.uniform(0, most.most_deg) * EIGEN_PI / 180;
    const Vector3d axis = random.direction(), shift = random.uniform(0, most.most_mm) * random.direction();
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

constexpr double pair_depth_mm = 3, target_depth_mm = 1;
constexpr int least_pairs = 4, more_pairs = 7;
constexpr double least_seen = 0.25, most_seen = 0.5;  // share of the surface

/// What all families have in common: vessels and images, drawn from numbers of their own.
void add_vessels_and_images(Phantom& phantom, const detail::TrueTissue& tissue, std::uint64_t seed,
                            const PhantomOptions& options) {
    constexpr std::uint64_t of_vessels = 101, of_images = 102, of_ultrasound = 103;
    detail::Random random(derived(seed, of_vessels));
    phantom.curves = detail::vessels(tissue, options.point_deviation_mm, random);
    phantom.images = [tissue, seed] {
        detail::Random of_its_own(derived(seed, of_images));
        return detail::drawn_images(tissue, of_its_own);
    };
    phantom.ultrasound = [tissue, seed, echoes = options.echoes] {
        detail::Random of_its_own(derived(seed, of_ultrasound));
        return detail::drawn_ultrasound(tissue, echoes, of_its_own);
    };
}

/// The tissue of a truth, which both share.
detail::TrueTissue tissue_of(const std::shared_ptr<const detail::Truth>& truth, const detail::OrganShape& shape,
                             const Eigen::Isometry3d& placement) {
    const auto& mesh = truth->mesh.quadratic;
    auto there = std::make_shared<const detail::QuadraticMap>(mesh, truth->displacement);
    tled::QuadraticMesh deformed = mesh;
    deformed.nodes += truth->displacement;
    auto back = std::make_shared<const detail::QuadraticMap>(std::move(deformed), -truth->displacement);
    detail::TrueTissue tissue;
    tissue.label = [shape](const Vector3d& X) { return shape.label(X); };
    tissue.outer_distance = [shape](const Vector3d& X) { return shape.outer_distance(X); };
    tissue.forward = [there, placement](const Vector3d& X) -> std::optional<Vector3d> {
        const auto moved = (*there)(X);
        if (!moved) return std::nullopt;
        return Vector3d(placement * *moved);
    };
    tissue.backward = [back, placement](const Vector3d& x) { return (*back)(placement.inverse() * x); };
    tissue.placement = placement;
    tissue.centre = shape.centre();
    tissue.reach = shape.reach();
    tissue.length = shape.length();
    return tissue;
}

/// Whether a place without tissue (fixed frame) came from what is gone if it moved as the tissue next to it did.
std::function<bool(const Vector3d&)> hollow_of(const std::shared_ptr<const detail::Truth>& truth,
                                               const detail::ResectedShape& shape, const Eigen::Isometry3d& placement) {
    const Eigen::Matrix3Xd places = truth->mesh.quadratic.nodes + truth->displacement;
    const auto nearest = std::make_shared<const meshing::PointTree>(places);
    return [truth, shape, nearest, back = placement.inverse()](const Vector3d& x) {
        const Vector3d y = back * x;
        return shape.label(y - truth->displacement.col(nearest->nearest(y).index)) == 2;
    };
}

/// A patient with a tumour, of whom all or what a resection leaves is deformed.
Phantom resection_phantom(std::uint64_t seed, const PhantomOptions& options, Observer& observer) {
    constexpr int elements = 3500;
    constexpr double strain = 0.12, most_grey = 180, least_grey = 20;
    constexpr std::uint64_t of_places = 111;
    const bool open = options.family == Family::Opened, gone = open || options.family == Family::Resected;
    detail::Random random(seed);
    const detail::ResectedOrgan organ =
        detail::random_resection(random, open ? detail::Access::Corridor : detail::Access::None);
    const detail::OrganShape& shape = organ.shape.organ();
    const double motion_mm = random.uniform(3, std::min(15.0, strain * shape.length()));
    const Eigen::Isometry3d placement =
        random_motion(shape.centre(), options.misplacement.value_or(solved_motion), random);
    const double seen_share = random.uniform(least_seen, most_seen), grey = random.uniform(least_grey, most_grey);

    observer.checkpoint("Truth", 0);
    detail::ResectionMeshes meshes = detail::resection_meshes(organ, elements, observer);
    const auto truth = std::make_shared<const detail::Truth>(
        gone ? detail::resected_truth(organ, std::move(meshes.resected), motion_mm, observer)
             : detail::unresected_truth(organ, std::move(meshes.whole), motion_mm, observer));
    detail::TrueTissue tissue = tissue_of(truth, shape, placement);
    if (gone) tissue.cavity_grey = organ.air ? 0 : grey;
    if (open) tissue.hollow = hollow_of(truth, organ.shape, placement);

    observer.checkpoint("Drawing", 0.8);
    Phantom phantom;
    phantom.moving_labels = detail::draw(shape, options.voxel_mm);
    auto* voxel = phantom.moving_labels.data<std::int32_t>();
    const auto& grid = phantom.moving_labels.geometry;
    for (int k = 0; k < grid.size[2]; ++k)
        for (int j = 0; j < grid.size[1]; ++j)
            for (int i = 0; i < grid.size[0]; ++i)
                *voxel++ = organ.shape.label(grid.point({double(i), double(j), double(k)}));
    if (gone) phantom.resected = {2};
    detail::Random of_places_alone(derived(seed, of_places));  // the same in the whole organ
    detail::TrueTissue mapped = tissue;
    mapped.label = [at = organ.shape, gone](const Vector3d& X) {  // the wall of elements lies off the surface a little
        const int label = at.label(X), left = at.organ().label(X) == 2 ? 3 : 1;
        return gone && label == 2 ? left : label;
    };
    phantom.fixed_labels = detail::drawn_labels(mapped, options.voxel_mm, options.boundary_deviation_mm, random);
    phantom.surface = detail::seen_surface(tissue, seen_share, options.point_deviation_mm, random);
    detail::TrueTissue left = tissue;
    left.label = [at = organ.shape](const Vector3d& X) { return at.cavity_distance(X) > 1 ? at.label(X) : 0; };
    phantom.targets = detail::places(left, options.targets, target_depth_mm, of_places_alone);
    phantom.points = detail::found_again(detail::places(left, more_pairs, pair_depth_mm, random),
                                         options.point_deviation_mm, random);
    phantom.story = told({shape, organ.tissue, organ.loads}, *truth, seen_share, more_pairs) + organ.words;
    add_vessels_and_images(phantom, tissue, seed, options);
    return phantom;
}

Phantom solved_phantom(std::uint64_t seed, const PhantomOptions& options, Observer& observer) {
    constexpr int least_elements = 2500, most_elements = 4000;
    constexpr double strain = 0.12;  // largest motion over the organ's length, at most
    detail::Random random(seed);
    detail::RandomOrgan organ = detail::random_organ(random);
    const detail::OrganShape& shape = organ.shape;
    const bool bulges = options.family == Family::Bulged;
    if (bulges) organ.loads = detail::bulging_loads(shape, organ.tissue.youngs_modulus_kpa, random);
    const double motion_mm = random.uniform(3, std::min(15.0, strain * shape.length()));
    const int elements = least_elements + random.index(most_elements - least_elements);
    const Eigen::Isometry3d placement =
        random_motion(shape.centre(), options.misplacement.value_or(solved_motion), random);
    const double seen_share = random.uniform(least_seen, most_seen);
    const int pairs = least_pairs + random.index(more_pairs);

    observer.checkpoint("Truth", 0);
    detail::TruthMesh mesh = detail::truth_mesh(shape, elements, observer);
    organ.loads = detail::sized_loads(organ, mesh, motion_mm);
    const auto truth = std::make_shared<const detail::Truth>(detail::equilibrium(organ, std::move(mesh), observer));
    const detail::TrueTissue tissue = tissue_of(truth, shape, placement);
    const detail::DeformedOrgan deformed{truth->mesh, placement * (truth->mesh.quadratic.nodes + truth->displacement)};

    observer.checkpoint("Drawing", 0.8);
    Phantom phantom;
    phantom.moving_labels = detail::draw(shape, options.voxel_mm);
    phantom.fixed_labels = detail::drawn_labels(deformed, options.voxel_mm, options.boundary_deviation_mm, random);
    std::optional<Vector3d> opening;
    if (bulges) opening = placement.linear() * shape.normal(organ.loads.pressures.front().cap.middle);
    phantom.surface = detail::seen_surface(deformed, seen_share, options.point_deviation_mm, random, opening);
    phantom.points =
        detail::found_again(detail::places(tissue, pairs, pair_depth_mm, random), options.point_deviation_mm, random);
    phantom.targets = detail::places(tissue, options.targets, target_depth_mm, random);
    phantom.story = told(organ, *truth, seen_share, pairs);
    add_vessels_and_images(phantom, tissue, seed, options);
    return phantom;
}

/// How tissue is bent before it is moved as a whole.
struct Bend {
    std::function<Vector3d(const Vector3d&)> forward, backward;
    double motion_mm;  ///< at most
};

Bend random_bend(const detail::TrueTissue& tissue, double motion_mm, const PhantomOptions& options,
                 detail::Random& random) {
    const auto shared = [](const auto& map, double most_mm) {
        return Bend{[map](const Vector3d& X) { return map->forward(X); },
                    [map](const Vector3d& x) { return map->backward(x); }, most_mm};
    };
    if (options.family != Family::Found) {
        const detail::BentMap map(tissue.centre, tissue.length, motion_mm, random);
        return shared(std::make_shared<const detail::BentMap>(map), motion_mm);
    }
    const imaging::Volume& field = options.fields[std::size_t(random.index(int(options.fields.size())))];
    const detail::FieldMap map(field, tissue, motion_mm, random);
    return shared(std::make_shared<const detail::FieldMap>(map), map.motion_mm());
}

/// An organ that a smooth map bends, whatever gives its shape.
Phantom bent_phantom(detail::TrueTissue tissue, imaging::Volume moving_labels, const std::string& kind,
                     std::uint64_t seed, const PhantomOptions& options, detail::Random& random) {
    constexpr double strain = 0.12;
    const double motion_mm = random.uniform(3, std::min(15.0, strain * tissue.length));
    const double seen_share = random.uniform(least_seen, most_seen);
    const int pairs = least_pairs + random.index(more_pairs);
    const Bend bend = random_bend(tissue, motion_mm, options, random);
    const Eigen::Isometry3d placement =
        random_motion(tissue.centre, options.misplacement.value_or(bent_motion), random);
    tissue.forward = [=](const Vector3d& X) { return Vector3d(placement * bend.forward(X)); };
    tissue.backward = [=](const Vector3d& x) { return bend.backward(placement.inverse() * x); };
    tissue.placement = placement;
    Phantom phantom;
    phantom.moving_labels = std::move(moving_labels);
    phantom.fixed_labels = detail::drawn_labels(tissue, options.voxel_mm, options.boundary_deviation_mm, random);
    phantom.surface = detail::seen_surface(tissue, seen_share, options.point_deviation_mm, random);
    phantom.points =
        detail::found_again(detail::places(tissue, pairs, pair_depth_mm, random), options.point_deviation_mm, random);
    phantom.targets = detail::places(tissue, options.targets, target_depth_mm, random);
    char text[200];
    std::snprintf(text, sizeof text, "%s, %.0f mm; bent by up to %.1f mm; %.0f %% of the surface and %d places seen",
                  kind.c_str(), tissue.length, bend.motion_mm, 100 * seen_share, pairs);
    phantom.story = text;
    add_vessels_and_images(phantom, tissue, seed, options);
    return phantom;
}

Phantom drawn_phantom(std::uint64_t seed, const PhantomOptions& options, Observer& observer) {
    if (options.family == Family::Solved || options.family == Family::Bulged)
        return solved_phantom(seed, options, observer);
    if (options.family == Family::Resected || options.family == Family::Opened || options.family == Family::Unresected)
        return resection_phantom(seed, options, observer);
    detail::Random random(seed);
    detail::TrueTissue tissue;
    const auto of_shape = [&](auto shape) {
        tissue.label = [shape](const Vector3d& X) { return shape->label(X); };
        tissue.outer_distance = [shape](const Vector3d& X) { return shape->outer_distance(X); };
        tissue.centre = shape->centre();
        tissue.reach = shape->reach();
        tissue.length = shape->length();
    };
    if (takes_organs(options.family)) {
        constexpr double least_ml = 50;
        const auto organ =
            std::make_shared<const detail::LabelOrgan>(detail::random_label_organ(options.organs, least_ml, random));
        of_shape(organ);
        return bent_phantom(std::move(tissue), organ->voxels(), organ->kind(), seed, options, random);
    }
    const auto shape = std::make_shared<const detail::OrganShape>(random);
    of_shape(shape);
    return bent_phantom(std::move(tissue), detail::draw(*shape, options.voxel_mm), shape->kind() + "-like", seed,
                        options, random);
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
