#include "tled/stiffness/effect_stiffness.hpp"

#include <array>
#include <cmath>

namespace tissuewarp::tled::detail {
namespace {

using Eigen::Vector3d;

class RowAppender {
public:
    explicit RowAppender(RankOneRows& rows)
        : rows_(rows), stiffness_(rows.stiffness.data(), rows.stiffness.data() + rows.stiffness.size()) {
        if (rows_.offset.empty()) rows_.offset.push_back(0);
    }
    ~RowAppender() {
        rows_.stiffness = Eigen::Map<Eigen::VectorXd>(stiffness_.data(), Eigen::Index(stiffness_.size()));
    }
    RowAppender(const RowAppender&) = delete;
    RowAppender& operator=(const RowAppender&) = delete;

    template <std::size_t Count>
    void append(double stiffness, const std::array<int, Count>& nodes, const std::array<Vector3d, Count>& gradient) {
        stiffness_.push_back(stiffness);
        rows_.node.insert(rows_.node.end(), nodes.begin(), nodes.end());
        rows_.gradient.insert(rows_.gradient.end(), gradient.begin(), gradient.end());
        rows_.offset.push_back(static_cast<int>(rows_.node.size()));
    }

private:
    RankOneRows& rows_;
    std::vector<double> stiffness_;
};

/// Strains of a face, linear in the displacements of its corners: ε_ij = ½ Σ_c (t_i·u_c ∂_j N_c + t_j·u_c ∂_i N_c) with
/// the axes t of its plane.
void append_membrane(const SurfaceEffects& effects, const Eigen::Matrix3Xd& position, Eigen::Index f,
                     RowAppender& rows) {
    const Eigen::Vector3i face = effects.membrane_faces.col(f);
    const auto d = effects.membrane_rest.col(f);
    const Eigen::Matrix2d to_rest{{d[0], d[1]}, {0, d[2]}};
    Eigen::Matrix<double, 3, 2> edges;
    edges << position.col(face[1]) - position.col(face[0]), position.col(face[2]) - position.col(face[0]);
    const Eigen::Matrix<double, 3, 2> axes = edges * to_rest;
    Eigen::Matrix<double, 3, 2> slope;  // row c: ∂N_c along the axes
    slope.row(1) = to_rest.row(0);
    slope.row(2) = to_rest.row(1);
    slope.row(0) = -slope.row(1) - slope.row(2);
    std::array<Vector3d, 3> first, second, shear, area;
    for (int c = 0; c < 3; ++c) {
        const auto at = static_cast<std::size_t>(c);
        first[at] = slope(c, 0) * axes.col(0);
        second[at] = slope(c, 1) * axes.col(1);
        shear[at] = std::sqrt(0.5) * (slope(c, 1) * axes.col(0) + slope(c, 0) * axes.col(1));
        area[at] = first[at] + second[at];
    }
    const std::array<int, 3> nodes{face[0], face[1], face[2]};
    for (const auto* strain : {&first, &second, &shear, &area})
        rows.append(2 * effects.membrane_stiffness[f], nodes, *strain);
}

}  // namespace

void add_effects(const SurfaceEffects& effects, const Eigen::Matrix3Xd& position, Stiffness& stiffness) {
    if (effects.sliding.empty() && effects.parting.empty() && effects.membrane_faces.cols() == 0) return;
    {
        RowAppender rows(stiffness.products);
        for (const std::vector<SlidingPair>* pairs : {&effects.sliding, &effects.parting})
            for (const SlidingPair& pair : *pairs)
                rows.append(pair.stiffness, std::array{pair.first, pair.second},
                            std::array<Vector3d, 2>{pair.normal, -pair.normal});
        for (Eigen::Index f = 0; f < effects.membrane_faces.cols(); ++f) append_membrane(effects, position, f, rows);
    }
    list_by_node(static_cast<int>(position.cols()), stiffness.products);
}

}  // namespace tissuewarp::tled::detail
