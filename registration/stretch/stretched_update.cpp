#include "registration/stretch/stretched_update.hpp"

#include "core/stopwatch.hpp"
#include "registration/boundary/surroundings.hpp"
#include "registration/pose/start_pose.hpp"
#include "registration/stretch/free_stretch.hpp"
#include "registration/stretch/strain_free.hpp"
#include "registration/terms/labels.hpp"

#include <utility>

namespace tissuewarp::registration {

namespace {

/// Errors along all axes alike, of a share of each node's displacement (3 × N, mm).
void add_share_of(const Eigen::Matrix3Xd& displacement, NodalErrors& nodal) {
    const Eigen::RowVectorXd squares =
        stretch_errors.share * stretch_errors.share * displacement.colwise().squaredNorm();
    nodal.data += squares;
    nodal.covariance.topRows<3>().rowwise() += squares / 3;
}

}  // namespace

bool stretches_freely(const PreparedModel& prepared, const Intraoperative& seen, const Tissue& tissue) {
    return tissue.free_stretch > 0 && seen.labels && !seen.image && !seen.surface && !seen.points && !seen.curves &&
           prepared.options.anchors.empty() && detail::not_meshed(prepared.options).empty();
}

StretchedUpdate update_stretched(const PreparedModel& prepared, const Intraoperative& seen, const Tissue& tissue,
                                 const UpdateOptions& options, Observer& observer) {
    Stopwatch stopwatch;
    const Eigen::Isometry3d start = seen.start.value_or(Eigen::Isometry3d::Identity());
    const detail::FreeStretch found =
        detail::find_free_stretch(prepared.labels, *detail::seen_from(seen, start).labels, tissue.free_stretch,
                                  options.align ? &options.alignment : nullptr, observer);
    const double searched = stopwatch.lap();
    auto model = std::make_shared<const PreparedModel>(detail::strain_free_under(prepared, found.stretch, observer));
    const double remade = stopwatch.lap();
    UpdateOptions within = options;
    within.align = false;
    UpdateResult result =
        Updater(model, within, observer).update({.labels = seen.labels, .start = start * found.placement}, observer);
    result.alignment.mean_distance_mm = found.mean_distance_mm;
    result.min_jacobian *= found.stretch.linear().determinant();
    result.times.insert(result.times.begin(), {{"free stretch", searched}, {"stretched model", remade}});
    if (auto doubt = detail::doubt_of_growth(prepared.labels, *seen.labels, tissue.most_growth))
        result.doubts.push_back(std::move(*doubt));
    result.deformation.displacement += found.stretch * prepared.model.mesh.nodes - prepared.model.mesh.nodes;
    result.deformation.mesh = prepared.model.mesh;
    return {std::move(result), found.stretch, std::move(model)};
}

Uncertainty uncertainty(const StretchedUpdate& update, const UncertaintyOptions& options, Observer& observer) {
    UpdateResult solved = update.result;
    const meshing::TetMesh given = solved.deformation.mesh;
    const meshing::TetMesh& mesh = update.strain_free->model.mesh;
    solved.deformation.displacement += given.nodes - mesh.nodes;
    solved.deformation.mesh = mesh;
    const Uncertainty there = uncertainty(*update.strain_free, solved, options, observer);
    NodalErrors nodal = there.nodal();
    add_share_of(update.result.deformation.displacement, nodal);
    return {given, std::move(nodal), there.held_out()};
}

}  // namespace tissuewarp::registration
