#include "registration/evaluation.hpp"

#include "core/errors.hpp"
#include "registration/evaluation/percentile.hpp"
#include "registration/field.hpp"

#include <Eigen/Dense>

#include <array>
#include <cstdio>
#include <numeric>
#include <string>

namespace tissuewarp::registration {

namespace {

using imaging::Geometry;
using imaging::Volume;

constexpr std::size_t most_places = 20;

/// Percentiles of weighted values in ascending order: value n sits at the cumulated mean weight of its neighbours up to
/// there, linear in between. With equal weights this is the percentile above.
class WeightedPercentiles {
public:
    WeightedPercentiles(const std::vector<double>& ascending, const std::vector<double>& weights)
        : values_(ascending), position_(ascending.size(), 0.0) {
        for (std::size_t n = 1; n < values_.size(); ++n)
            position_[n] = position_[n - 1] + 0.5 * (weights[n - 1] + weights[n]);
    }
    [[nodiscard]] double operator()(double percent) const {
        const double wanted = percent / 100.0 * position_.back();
        const auto above = std::upper_bound(position_.begin(), position_.end(), wanted);
        if (above == position_.begin() || above == position_.end()) return values_.back();
        const auto n = static_cast<std::size_t>(above - position_.begin());
        const double fraction = (wanted - position_[n - 1]) / (position_[n] - position_[n - 1]);
        return values_[n - 1] + fraction * (values_[n] - values_[n - 1]);
    }

private:
    const std::vector<double>& values_;
    std::vector<double> position_;
};

}  // namespace

JacobianReport mesh_jacobians(const Deformation& deformation) {
    const auto& mesh = deformation.mesh;
    meshing::require_valid(mesh, "deformation");
    if (deformation.displacement.cols() != mesh.nodes.cols() || !deformation.displacement.allFinite())
        throw InvalidInput("mesh Jacobians: needs one finite displacement for each of the " +
                           std::to_string(mesh.node_count()) + " nodes");
    const Eigen::VectorXd rest = meshing::tet_volumes(mesh);
    const Eigen::VectorXd now = meshing::tet_volumes({mesh.nodes + deformation.displacement, mesh.tets, mesh.labels});
    std::vector<int> order(static_cast<std::size_t>(mesh.tet_count()));
    std::iota(order.begin(), order.end(), 0);
    const Eigen::VectorXd ratio = now.cwiseQuotient(rest);
    std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return ratio[x] < ratio[y]; });

    JacobianReport report;
    std::vector<double> values, weights;
    for (const int tet : order) {
        values.push_back(ratio[tet]);
        weights.push_back(rest[tet]);
        if (ratio[tet] > 0.0) continue;
        ++report.folded;
        report.folded_mm3 += rest[tet];
        if (report.folded_places.size() < most_places)
            report.folded_places.emplace_back(mesh.nodes(Eigen::all, mesh.tets.col(tet)).rowwise().mean());
    }
    const WeightedPercentiles at(values, weights);
    report.minimum = values.front();
    report.percentile_1 = at(1.0);
    report.percentile_5 = at(5.0);
    report.median = at(50.0);
    report.percentile_95 = at(95.0);
    report.percentile_99 = at(99.0);
    report.folded_share = report.folded_mm3 / rest.sum();
    report.maximum = values.back();
    return report;
}

JacobianReport field_jacobians(const Volume& moving_to_fixed, const Volume* mask) {
    return jacobian_report(jacobian_determinant(moving_to_fixed), mask);
}

JacobianReport jacobian_report(const Volume& determinant, const Volume* mask) {
    if (mask && !imaging::same_grid(mask->geometry, determinant.geometry))
        throw InvalidInput("field Jacobians: the mask lies on another grid; resample it onto the grid of the field");
    const Volume chosen = mask ? Volume(mask->geometry, cv::Mat(mask->voxels != 0)) : Volume();
    const Geometry& grid = determinant.geometry;
    const auto* value = determinant.data<float>();
    std::vector<float> values;
    values.reserve(static_cast<std::size_t>(mask ? 0 : grid.voxel_count()));
    std::vector<std::int64_t> folded;
    for (std::int64_t n = 0; n < grid.voxel_count(); ++n) {
        if (mask && !chosen.data<std::uint8_t>()[n]) continue;
        if (!std::isfinite(value[n]))
            throw InvalidInput("field Jacobians: the field is not finite around voxel " + std::to_string(n) +
                               "; repair the field");
        values.push_back(value[n]);
        if (value[n] <= 0.0F) folded.push_back(n);
    }
    if (values.empty()) throw InvalidInput("field Jacobians: the mask is empty; give one with voxels");

    JacobianReport report;
    report.folded = static_cast<long long>(folded.size());
    report.folded_mm3 = static_cast<double>(folded.size()) * grid.voxel_volume();
    std::stable_sort(folded.begin(), folded.end(), [&](auto x, auto y) { return value[x] < value[y]; });
    folded.resize(std::min(folded.size(), most_places));
    for (const std::int64_t n : folded) {
        const std::int64_t row = n / grid.size[0];
        report.folded_places.push_back(
            grid.point(Eigen::Array<std::int64_t, 3, 1>(n % grid.size[0], row % grid.size[1], row / grid.size[1])
                           .cast<double>()
                           .matrix()));
    }
    report.minimum = *std::min_element(values.begin(), values.end());
    report.maximum = *std::max_element(values.begin(), values.end());
    const std::array found = detail::percentiles(values, std::array{1.0, 5.0, 50.0, 95.0, 99.0});
    report.percentile_1 = found[0];
    report.percentile_5 = found[1];
    report.median = found[2];
    report.percentile_95 = found[3];
    report.percentile_99 = found[4];
    report.folded_share = static_cast<double>(report.folded) / static_cast<double>(values.size());
    return report;
}

std::optional<Doubt> doubt_of_folds(const JacobianReport& everywhere, const JacobianReport& in_organ,
                                    const Unfolding& back) {
    if (everywhere.folded == 0 && back.left == 0) return std::nullopt;
    char least[32];
    std::snprintf(least, sizeof least, "%.3g", everywhere.minimum);
    const std::string forth = "the displacement field folds in " + std::to_string(everywhere.folded) + " voxels, " +
                              std::to_string(in_organ.folded) + " of them in the organ, and its det J falls to " +
                              least;
    const std::string backward = "the backward field folds in " + std::to_string(back.left) + " voxels";
    return Doubt{
        "field.folds", double(everywhere.folded + back.left), 0,
        everywhere.folded == 0 ? backward
        : back.left == 0       ? forth
                               : forth + "; " + backward,
        "do not trust it there (report.json lists places); a finer mesh, or labels and points that do not pull "
        "against each other there"};
}

std::optional<Doubt> doubt_of_unfolding(const Unfolding& forth, const Unfolding& back) {
    const Unfolding& unfolding = forth.most_in_organ_mm > back.most_in_organ_mm ? forth : back;
    if (unfolding.most_in_organ_mm <= unfolding_doubt_limits.most_mm) return std::nullopt;
    char text[240];
    std::snprintf(text, sizeof text,
                  "the displacement field folded where parts of the organ pass into each other or slid far along what "
                  "lies beside them; so that it does not, %lld voxels of the organ gave way, by up to %.2g mm",
                  static_cast<long long>(unfolding.in_organ), unfolding.most_in_organ_mm);
    const bool few = double(unfolding.in_organ) < unfolding_doubt_limits.least_share * double(unfolding.organ);
    return Doubt{"field.unfolded",
                 unfolding.most_in_organ_mm,
                 unfolding_doubt_limits.most_mm,
                 text,
                 "look where it slid or labels lie close together; name labels that slide on each other by --sliding",
                 few ? Severity::Notice : Severity::Doubt};
}

}  // namespace tissuewarp::registration
