#include "registration/uncertainty/data_uncertainty.hpp"

#include "registration/loads/unknown_bends.hpp"
#include "registration/loads/unknown_loads.hpp"
#include "registration/loads/white_noise.hpp"
#include "registration/pose/rigid_part.hpp"
#include "registration/pose/shown_motions.hpp"
#include "registration/springs/ground_springs.hpp"
#include "registration/uncertainty/error_model.hpp"
#include "registration/uncertainty/held_out.hpp"
#include "registration/uncertainty/slip_motions.hpp"
#include "tled/model/symmetric.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace tissuewarp::registration::detail {

namespace {

using Covariances = Eigen::Matrix<double, 6, Eigen::Dynamic>;
using Eigen::MatrixXd;

/// Of every node's displacement, the sum over 3N × k of d dᵀ.
Covariances sum_of_squares(const MatrixXd& displacements) {
    Covariances result(6, displacements.rows() / 3);
    for (Eigen::Index n = 0; n < result.cols(); ++n) {
        const Eigen::Matrix<double, 3, Eigen::Dynamic> here = displacements.middleRows<3>(3 * n);
        result.col(n) = tled::symmetric_entries(here * here.transpose());
    }
    return result;
}

/// Over samples of mean 0.
Covariances covariances_of(const MatrixXd& samples) {
    return sum_of_squares(samples) / double(samples.cols());
}

/// Displacements under loads, both times a factor: as large as the tissue was seen to strain, by strain energy, where
/// it would be seen to move as `visible` (3N × k, mm) under those drawn.
void give_size(Truths& truths, MatrixXd& missed, const PreparedModel& prepared, double strain_energy) {
    const MatrixXd visible = truths.displacement - missed;
    const auto stiffness = tled::tangent_stiffness(prepared.rest, Eigen::Matrix3Xd::Zero(3, prepared.rest.node_count));
    const double drawn = 0.5 * visible.cwiseProduct(stiffness * visible).sum() / double(visible.cols());
    const double size = std::sqrt(strain_energy / drawn);
    for (MatrixXd* part : {&truths.displacement, &truths.loads, &missed}) *part *= size;
}

/// What the registration misses of truths that loads of one kind bring about.
struct Missed {
    Truths truths;
    MatrixXd error;  ///< 3N × k, mm
};

Missed missed_under(MatrixXd loads, const PreparedModel& prepared, const LinearRegistration& registration,
                    const Posterior& unseen, double strain_energy) {
    Missed result;
    result.truths.displacement = unseen.inverse(loads);
    result.truths.loads = std::move(loads);
    result.error = registration.missed(result.truths);
    give_size(result.truths, result.error, prepared, strain_energy);
    return result;
}

/// Of displacements (3N × k, mm) beside their motions as a whole, root mean square.
double elastic_motion_mm(const MatrixXd& displacements, const Eigen::Matrix3Xd& nodes) {
    const MatrixXd motions = rigid_motions(nodes);
    const MatrixXd rigid = motions * (motions.transpose() * motions).ldlt().solve(motions.transpose() * displacements);
    return std::sqrt((displacements - rigid).squaredNorm() / double(nodes.cols() * displacements.cols()));
}

/// How large errors are over what strain energy says. Noise that the tissue followed strains it much in short waves
/// that move it little, and loads of longer waves with that energy would move it far: where the motion that was found
/// is less than theirs, the size lies between what both say. `least` is the share of both that nothing found lessens.
/// Where data show the organ as a whole their energy stands: what labels of lungs miss is as large.
double size_by_motion(const Missed& missed, const Eigen::Matrix3Xd& nodes, double found_mm, double least) {
    const double expected_mm = elastic_motion_mm(missed.truths.displacement - missed.error, nodes);
    return std::pow(std::clamp(found_mm / expected_mm, least, 1.0), error_model.motion_weight);
}

MatrixXd beside(const MatrixXd& a, const MatrixXd& b) {
    MatrixXd result(a.rows(), a.cols() + b.cols());
    result << a, b;
    return result;
}

/// What a model of how organs move says: what registrations miss of such motions, and some of the motions themselves.
struct Model {
    MatrixXd error;   ///< 3N × k, mm
    MatrixXd truths;  ///< 3N × HeldOutOptions::draws, mm
};

/// Strain energy that was found, and the unit, mN mm.
struct Energies {
    double found = 0, unit = 1;
};

/// Unknown loads on and in the organ, of the size that tells the strain energy found.
Model under_unknown_loads(const PreparedModel& prepared, PriorMoves prior_moves, const LinearRegistration& registration,
                          const Posterior& unseen, const Eigen::Matrix3Xd& displacement, const Energies& energies,
                          const UncertaintyOptions& options) {
    const int half = options.samples / 2;
    const double energy = energies.found + error_model.least_energy * energies.unit;
    const Missed on = missed_under(unknown_loads(prepared, half, options.seed), prepared, registration, unseen, energy),
                 in = missed_under(unknown_body_forces(prepared, half, options.seed + 1), prepared, registration,
                                   unseen, energy);
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const auto sized = [&, least = std::sqrt(1 - energies.found / energy),
                        found_mm = elastic_motion_mm(displacement.reshaped(), nodes)](const Missed& missed) {
        const bool whole = prior_moves == PriorMoves::Not;
        return MatrixXd((whole ? 1 : size_by_motion(missed, nodes, found_mm, least)) * missed.error);
    };
    constexpr int half_of_draws = HeldOutOptions().draws / 2;
    return {beside(sized(on), sized(in)),
            beside(on.truths.displacement.leftCols(half_of_draws), in.truths.displacement.leftCols(half_of_draws))};
}

/// Smooth bends, bend_mm in root mean square.
Model bent_by(double bend_mm, const PreparedModel& prepared, const LinearRegistration& registration,
              const Posterior& unseen, const UncertaintyOptions& options) {
    Truths truths;
    truths.loads = unknown_bends(prepared, options.samples, options.seed);
    truths.displacement = unseen.inverse(truths.loads);
    const double drawn_mm =
        std::sqrt(truths.displacement.squaredNorm() / double(prepared.rest.node_count * options.samples));
    for (MatrixXd* part : {&truths.loads, &truths.displacement}) *part *= bend_mm / drawn_mm;
    return {registration.missed(truths), truths.displacement.leftCols(HeldOutOptions().draws)};
}

/// Of points of it alone, tissue bends smoothly, and a registration that found bends finds them here too; seen as a
/// whole or by its grey values, tissue does what its loads say.
Model model_of(const PreparedModel& prepared, const LastPulls& pulls, const Eigen::Matrix3Xd& displacement,
               const Energies& energies, const Posterior& unseen, LinearRegistration& registration,
               const UncertaintyOptions& options) {
    if (pulls.prior_moves != PriorMoves::WithSurface)
        return under_unknown_loads(prepared, pulls.prior_moves, registration, unseen, displacement, energies, options);
    const double expected_mm = expected_bend_mm(prepared);
    if (pulls.load_size == 0) return bent_by(expected_mm, prepared, registration, unseen, options);
    LoadShapes shapes(principal_bends(prepared, TissuePrior().load_shapes).loads, unseen, pulls.energy);
    const double found_mm = pulls.load_size * shapes.deviation_mm();
    registration = std::move(registration).with_loads({std::move(shapes), pulls.load_size});
    // A part tells little of how far the rest bends: where it tells less than expected, the truth lies between both.
    return bent_by(std::max(found_mm, std::sqrt(found_mm * expected_mm)), prepared, registration, unseen, options);
}

DataErrors few_of(const DataErrors& errors, Eigen::Index count) {
    DataErrors result;
    for (const MatrixXd& each : errors) result.emplace_back(each.leftCols(count));
    return result;
}

/// What would be known of the organ without data. Labels show where it lies, however it turned, and an image's prior of
/// tissue out of view is the registration's alone: of an organ nothing is known then but that it moved some.
LastPulls nothing_seen(const PreparedModel& prepared, LastPulls pulls) {
    if (!pulls.parts_alone) expect_free_motion(pulls, prepared, TissuePrior().free_motion_mm);
    return pulls;
}

/// Of a motion of the organ as a whole of which the data show this share s: what springs mistake for it is as large as
/// they feel little of it, like 1/√s.
double unseen_deviation_mm(double share, const HardlyShown& hardly) {
    if (share < shown_motion_limits.least_share) return error_model.unseen_motion_mm;
    if (share >= hardly.below_share) return 0;
    return hardly.deviation_mm * std::min(1.0, std::sqrt(hardly.below_share / share) - 1);
}

/// One deviation of each motion of the organ as a whole beyond what the springs of the data leave open, 3N × 6, mm.
/// Parts that slid one way are hardly told from others that were turned the other way.
MatrixXd unseen_motions(const LastPulls& pulls, const PreparedModel& prepared, const Eigen::Matrix3Xd& displacement) {
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    if (!pulls.placement_sought) return MatrixXd(nodes.size(), 0);
    ShownMotions shown = shown_motions(pulls, nodes);
    HardlyShown hardly = pulls.hardly_shown;
    hardly.deviation_mm = std::hypot(hardly.deviation_mm, slip_model.of_slip * slid_mm(prepared.sliding, displacement));
    for (Eigen::Index k = 0; k < shown.shares.size(); ++k)
        shown.motions.col(k) *= unseen_deviation_mm(shown.shares[k], hardly);
    return std::move(shown.motions);
}

/// What is missed if the tissue was not deformed but moved as a whole, as nearly as data show it move (3N × 1, mm):
/// where the prior holds the rest back, A⁻¹ G' u.
MatrixXd missed_if_rigid(const LastPulls& pulls, const Eigen::Matrix3Xd& nodes, const Eigen::Matrix3Xd& displacement,
                         const LinearRegistration& registration) {
    if (!pulls.placement_sought || pulls.prior_moves != PriorMoves::Not) return MatrixXd(nodes.size(), 0);
    const MatrixXd motions = rigid_motions(nodes);
    const MatrixXd motion = motions * (rigid_part(motions, pulls.of(Origin::Datum)) * displacement.reshaped());
    return registration.inverse(forces_of(pulls.of(Origin::Prior), motion));
}

/// As many draws of how far parts may have slid beyond what was found.
MatrixXd drawn_slips(const MatrixXd& slips, Eigen::Index count, std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    return slips * white_noise(slips.cols(), count, generator);
}

/// What a registration does not follow of motions (3N × k, mm): u − S K_D u.
MatrixXd missed_of(const MatrixXd& motions, const LastPulls& pulls, const LinearRegistration& registration) {
    return motions - registration.inverse(forces_of(pulls.of(Origin::Datum), motions));
}

bool has_prior(const LastPulls& pulls) {
    return std::any_of(pulls.springs.begin(), pulls.springs.end(),
                       [](const PulledNode& pulled) { return pulled.origin == Origin::Prior; });
}

}  // namespace

OpenParts open_parts(const PreparedModel& prepared, const LastPulls& given, const Eigen::Matrix3Xd& displacement,
                     double strain_energy, const UncertaintyOptions& options) {
    const LastPulls unseen = nothing_seen(prepared, given), pulls = has_prior(given) ? given : unseen;
    auto [registration, without] = LinearRegistration::with_unseen(prepared, pulls, unseen);
    const Model model =
        model_of(prepared, given, displacement, {strain_energy, pulls.energy}, without, registration, options);
    const std::vector<PulledNode> data = pulls.data();
    const Eigen::Matrix3Xd& nodes = prepared.model.mesh.nodes;
    const DataErrors errors = drawn_errors(data, nodes, pulls.energy, options.samples, options.seed + 2);
    DataUncertainty result;
    result.covariance = covariances_of(model.error) +
                        covariances_of(registration.inverse(forces_of(data, errors, prepared.rest.node_count)));
    const MatrixXd slips = slip_motions(prepared, displacement);
    if (slips.cols() > 0) result.covariance += sum_of_squares(missed_of(slips, pulls, registration));
    const Covariances placement = sum_of_squares(beside(unseen_motions(pulls, prepared, displacement),
                                                        missed_if_rigid(pulls, nodes, displacement, registration)));
    constexpr int draws = HeldOutOptions().draws;
    const MatrixXd truths = model.truths.leftCols(draws) + drawn_slips(slips, draws, options.seed + 3);
    result.held_out = held_out(prepared, pulls, registration.posterior(), displacement, truths, few_of(errors, draws));
    if (result.held_out) result.covariance *= std::max(1.0, result.held_out->z * result.held_out->z);
    result.covariance += placement;
    return {std::move(result), std::move(registration).stiffness()};
}

}  // namespace tissuewarp::registration::detail
