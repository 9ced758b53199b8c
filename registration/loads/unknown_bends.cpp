#include "registration/loads/unknown_bends.hpp"

#include "registration/loads/smooth_field.hpp"
#include "registration/loads/unknown_loads.hpp"
#include "tled/stiffness/tangent_stiffness.hpp"

#include <Eigen/Eigenvalues>

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace tissuewarp::registration::detail {

namespace {

using Columns = Eigen::MatrixXd;  // 3N × k, nodes' vectors one after the other

Columns bends(const Eigen::Matrix3Xd& nodes, int count, std::uint64_t seed) {
    std::mt19937_64 generator(seed);
    std::vector<SolenoidalField> fields;
    for (int k = 0; k < count; ++k)
        fields.emplace_back(bend_draws.smooth_over * radius_of(nodes), bend_draws.waves, generator);
    Columns result(nodes.size(), count);
    tbb::parallel_for(0, count, [&](int k) {
        for (Eigen::Index n = 0; n < nodes.cols(); ++n)
            result.block<3, 1>(3 * n, k) = fields[static_cast<std::size_t>(k)](nodes.col(n));
    });
    return result;
}

/// K u of free tissue at rest.
Columns loads_of(const PreparedModel& prepared, const Columns& displacements) {
    return tled::tangent_stiffness(prepared.rest, Eigen::Matrix3Xd::Zero(3, prepared.rest.node_count)) * displacements;
}

/// The same on every mesh of an organ.
Columns draws_of(const PreparedModel& prepared) {
    return bends(prepared.model.mesh.nodes, bend_draws.draws, bend_draws.seed);
}

}  // namespace

Eigen::MatrixXd unknown_bends(const PreparedModel& prepared, int count, std::uint64_t seed) {
    return loads_of(prepared, bends(prepared.model.mesh.nodes, count, seed));
}

PrincipalBends principal_bends(const PreparedModel& prepared, int count) {
    const Columns drawn = draws_of(prepared);
    const Eigen::SelfAdjointEigenSolver<Columns> modes(drawn.transpose() * drawn);
    PrincipalBends result;
    result.axes = modes.eigenvectors().rightCols(std::min(count, bend_draws.draws));
    result.loads = loads_of(prepared, drawn * result.axes) / std::sqrt(double(bend_draws.draws));
    return result;
}

Eigen::MatrixXd bends_along(const PreparedModel& prepared, const Eigen::MatrixXd& axes) {
    return loads_of(prepared, draws_of(prepared) * axes) / std::sqrt(double(bend_draws.draws));
}

double expected_bend_mm(const PreparedModel& prepared) {
    return bend_draws.of_radius * radius_of(prepared.model.mesh.nodes);
}

}  // namespace tissuewarp::registration::detail
