#include "registration/detail/held_out.hpp"

#include "registration/terms/stated_loads.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <map>

namespace tissuewarp::registration::detail {

namespace {

using Block = std::array<int, 3>;

constexpr double ground_share = 0.01;

double mean_edge(const meshing::TetMesh& mesh) {
    double sum = 0;
    for (int tet = 0; tet < mesh.tet_count(); ++tet)
        for (int corner = 0; corner < 4; ++corner)
            sum += (mesh.nodes.col(mesh.tets(corner, tet)) - mesh.nodes.col(mesh.tets((corner + 1) % 4, tet))).norm();
    return sum / (4 * mesh.tet_count());
}

std::vector<Block> blocks_of(const meshing::TetMesh& mesh, double edge) {
    const Eigen::Vector3d corner = mesh.nodes.rowwise().minCoeff();
    std::vector<Block> blocks;
    for (const auto& node : mesh.nodes.colwise()) {
        const Eigen::Vector3d index = (node - corner) / edge;
        blocks.push_back({int(index[0]), int(index[1]), int(index[2])});
    }
    return blocks;
}

int half_of(const Block& block) {
    return (block[0] + block[1] + block[2]) % 2;
}

/// The springs as seen from the model after the last round gave its rigid part to the placement.
std::vector<tled::Spring> carried_along(std::vector<tled::Spring> springs, const meshing::TetMesh& mesh,
                                        const Eigen::Isometry3d& motion) {
    const Eigen::Matrix3d turn = motion.linear();
    for (tled::Spring& spring : springs) {
        const Eigen::Vector3d rest = mesh.nodes.col(spring.node);
        spring.target = motion * (rest + spring.target) - rest;
        spring.stiffness = turn * spring.stiffness * turn.transpose();
    }
    return springs;
}

/// Nodes in one element with any of `marked`, these included.
std::vector<bool> with_neighbours(const meshing::TetMesh& mesh, const std::vector<bool>& marked) {
    std::vector<bool> reached = marked;
    for (const auto& tet : mesh.tets.colwise()) {
        const bool any = std::any_of(tet.begin(), tet.end(), [&](int node) { return marked[std::size_t(node)]; });
        if (!any) continue;
        for (const int node : tet) reached[std::size_t(node)] = true;
    }
    return reached;
}

/// Without those that hardly pull: of data that no tissue follows, or at the far corners of elements.
std::vector<tled::Spring> strong(std::vector<tled::Spring> springs) {
    constexpr double least_share = 0.02;
    double strongest = 0;
    for (const tled::Spring& spring : springs) strongest = std::max(strongest, spring.stiffness.trace());
    std::erase_if(springs,
                  [&](const tled::Spring& spring) { return spring.stiffness.trace() < least_share * strongest; });
    return springs;
}

Eigen::Matrix3d square_root(const Eigen::Matrix3d& stiffness) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(stiffness);
    return axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * axes.eigenvectors().transpose();
}

}  // namespace

HeldOut::HeldOut(const PreparedModel& prepared, const UpdateResult& result, const FitOptions& options)
    : prepared_(prepared), tolerance_mm_(options.tolerance_mm), start_(result.deformation.displacement) {
    const meshing::TetMesh& mesh = prepared.model.mesh;
    const double edge = std::max(options.cube_mm, 3 * mean_edge(mesh));
    const std::vector<Block> blocks = blocks_of(mesh, edge), parts = blocks_of(mesh, edge / 2);
    const Eigen::Isometry3d motion = result.deformation.placement.inverse() * result.pulls.placement;
    std::vector<tled::Spring> pulls = result.pulls.data;
    pulls.insert(pulls.end(), result.pulls.holds.begin(), result.pulls.holds.end());
    const std::vector<tled::Spring> data = carried_along(strong(std::move(pulls)), mesh, motion);
    std::map<Block, int> numbers;
    std::vector<double> weights;  // of blocks
    for (int half = 0; half < 2; ++half) {
        Fold& fold = folds_[std::size_t(half)];
        std::vector<bool> pulled(std::size_t(mesh.node_count()), false);
        for (const tled::Spring& spring : data) {
            if (half_of(blocks[std::size_t(spring.node)]) == half) continue;
            fold.training.springs.push_back(spring);
            pulled[std::size_t(spring.node)] = true;
        }
        const std::vector<bool> near = with_neighbours(mesh, pulled);
        for (const tled::Spring& spring : data) {
            if (near[std::size_t(spring.node)]) continue;
            fold.judged.push_back(spring);
            fold.root.push_back(square_root(spring.stiffness));
            const auto [number, first] = numbers.try_emplace(parts[std::size_t(spring.node)], int(numbers.size()));
            if (first) weights.push_back(0);
            weights[std::size_t(number->second)] += fold.root.back().rowwise().squaredNorm().maxCoeff();
            block_of_.push_back(number->second);
        }
        for (const tled::Spring& spring : result.pulls.supports) fold.training.springs.push_back(spring);
        for (tled::Spring spring : result.pulls.ground) {
            spring.stiffness *= ground_share;
            fold.training.springs.push_back(spring);
        }
    }
    block_count_ = int(numbers.size());
    auto block = block_of_.begin();
    for (Fold& fold : folds_)
        for (Eigen::Matrix3d& root : fold.root) root /= std::sqrt(weights[std::size_t(*block++)]);
}

void HeldOut::take(const tled::MaterialTable& materials) {
    if (current_.engine && materials == current_.materials) return;
    const bool given = materials == prepared_.model.materials;
    current_.rest.reset();
    if (!given) {
        tled::Model model = prepared_.model;
        model.materials = materials;
        current_.rest = tled::rest_state(model);
    }
    const tled::RestState& rest = given ? prepared_.rest : *current_.rest;
    const auto conditions = [&](std::size_t fold) {
        return tled::nodal_conditions(folds_[fold].training, rest.node_count);
    };
    if (given)
        folds_[0].factor.emplace(rest, conditions(0), prepared_.stiffness);
    else
        folds_[0].factor.emplace(rest, conditions(0));
    folds_[1].factor.emplace(rest, conditions(1), *folds_[0].factor);
    current_.engine = tled::make_cpu_engine(rest, tled::Scalar::Float64);
    current_.materials = materials;
}

Eigen::Matrix3Xd HeldOut::displacement(Fold& fold, const Eigen::Matrix3Xd& loads, Observer& observer) {
    tled::Conditions conditions = fold.training;
    conditions.external_force = loads;
    tled::EquilibriumOptions options;
    options.tolerance_mm = tolerance_mm_;
    options.method = tled::EquilibriumMethod::Lbfgs;
    const auto solved =
        tled::equilibrium(*current_.engine, *fold.factor, tled::nodal_conditions(conditions, prepared_.rest.node_count),
                          options, &start_, observer);
    ++equilibria_;
    force_evaluations_ += solved.force_evaluations;
    return solved.displacement;
}

Eigen::Matrix3Xd HeldOut::residuals(const Tissue& tissue, Observer& observer) {
    take(tissue.materials);
    const Eigen::Matrix3Xd loads = nodal_forces(prepared_, tissue.loads);
    Eigen::Matrix3Xd result(3, Eigen::Index(block_of_.size()));
    Eigen::Index column = 0;
    for (Fold& fold : folds_) {
        const Eigen::Matrix3Xd u = displacement(fold, loads, observer);
        for (std::size_t s = 0; s < fold.judged.size(); ++s)
            result.col(column++) = fold.root[s] * (u.col(fold.judged[s].node) - fold.judged[s].target);
    }
    return result;
}

}  // namespace tissuewarp::registration::detail
