#include "tled/conditions.hpp"

#include "core/errors.hpp"

#include <Eigen/Cholesky>

#include "tled/model/symmetric.hpp"
#include "tled/parallel/parallel.hpp"

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::tled {

namespace {

void require_node(int node, int node_count, const char* what) {
    if (node < 0 || node >= node_count)
        throw InvalidInput(std::string(what) + " names node " + std::to_string(node) + "; the mesh has nodes 0 to " +
                           std::to_string(node_count - 1));
}

bool is_valid(const Spring& spring) {
    const Eigen::Matrix3d& k = spring.stiffness;
    const double size = k.norm();
    const Eigen::LLT<Eigen::Matrix3d> raised(k + 1e-9 * size * Eigen::Matrix3d::Identity());
    return k.allFinite() && spring.target.allFinite() && (k - k.transpose()).norm() <= 1e-9 * size &&
           (size == 0 || raised.info() == Eigen::Success);
}

void require_valid(const std::vector<Spring>& springs, int node_count) {
    std::vector<char> valid(springs.size());
    parallel_ranges(0, springs.size(), 256, [&](std::size_t begin, std::size_t end) {
        for (std::size_t n = begin; n < end; ++n) valid[n] = is_valid(springs[n]);
    });
    for (std::size_t n = 0; n < springs.size(); ++n) {
        require_node(springs[n].node, node_count, "a spring");
        if (!valid[n])
            throw InvalidInput("the spring at node " + std::to_string(springs[n].node) +
                               " needs a finite target and a symmetric positive semi-definite stiffness (mN/mm)");
    }
}

void sum_springs(const std::vector<Spring>& springs, int node_count, NodalConditions& nodal) {
    require_valid(springs, node_count);
    constexpr Eigen::Index none = -1;
    std::vector<Eigen::Index> column_of(static_cast<std::size_t>(node_count), none);
    for (const Spring& spring : springs) column_of[static_cast<std::size_t>(spring.node)] = 0;
    std::vector<int>& nodes = nodal.spring_node;
    for (int node = 0; node < node_count; ++node) {
        if (column_of[static_cast<std::size_t>(node)] == none) continue;
        column_of[static_cast<std::size_t>(node)] = static_cast<Eigen::Index>(nodes.size());
        nodes.push_back(node);
    }
    nodal.spring_stiffness = Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, static_cast<Eigen::Index>(nodes.size()));
    nodal.spring_force = Eigen::Matrix3Xd::Zero(3, static_cast<Eigen::Index>(nodes.size()));
    for (const Spring& spring : springs) {
        const Eigen::Index column = column_of[static_cast<std::size_t>(spring.node)];
        const Eigen::Matrix3d& k = spring.stiffness;
        nodal.spring_stiffness.col(column) += symmetric_entries(k);
        nodal.spring_force.col(column) += k * spring.target;
    }
}

NodalConditions without_effects(const Conditions& conditions, int node_count) {
    NodalConditions nodal;
    sum_springs(conditions.springs, node_count, nodal);
    nodal.constrained = Eigen::Matrix<bool, 3, Eigen::Dynamic>::Constant(3, node_count, false);
    nodal.imposed = Eigen::Matrix3Xd::Zero(3, node_count);
    for (const PrescribedDisplacement& prescribed : conditions.prescribed) {
        require_node(prescribed.node, node_count, "a prescribed displacement");
        for (int c = 0; c < 3; ++c) {
            if (!prescribed.constrained[static_cast<std::size_t>(c)]) continue;
            if (nodal.constrained(c, prescribed.node))
                throw InvalidInput("node " + std::to_string(prescribed.node) + " is prescribed twice");
            if (!std::isfinite(prescribed.displacement[c]))
                throw InvalidInput("the displacement prescribed at node " + std::to_string(prescribed.node) +
                                   " is not finite");
            nodal.constrained(c, prescribed.node) = true;
            nodal.imposed(c, prescribed.node) = prescribed.displacement[c];
        }
    }
    nodal.external_force = Eigen::Matrix3Xd::Zero(3, node_count);
    if (conditions.external_force.size() == 0) return nodal;
    if (conditions.external_force.cols() != node_count || !conditions.external_force.allFinite())
        throw InvalidInput("external forces need one finite vector (mN) for each of the " + std::to_string(node_count) +
                           " nodes");
    nodal.external_force = conditions.external_force;
    return nodal;
}

}  // namespace

NodalConditions nodal_conditions(const Conditions& conditions, const RestState& rest) {
    NodalConditions nodal = without_effects(conditions, rest.node_count);
    if (!conditions.effects.none()) nodal.effects = nodal_effects(conditions.effects, rest);
    return nodal;
}

NodalConditions nodal_conditions(const Conditions& conditions, int node_count) {
    if (!conditions.effects.none())
        throw InvalidInput("effects of the conditions need the rest state of the model: pass it for the node count");
    return without_effects(conditions, node_count);
}

NodalConditions with_springs(NodalConditions conditions, const std::vector<Spring>& springs) {
    struct Sum {
        Eigen::Matrix<double, 6, 1> stiffness = Eigen::Matrix<double, 6, 1>::Zero();
        Eigen::Vector3d force = Eigen::Vector3d::Zero();
    };
    NodalConditions more;
    sum_springs(springs, static_cast<int>(conditions.constrained.cols()), more);
    std::map<int, Sum> sums;
    for (const NodalConditions* each : {&std::as_const(conditions), &std::as_const(more)})
        for (std::size_t s = 0; s < each->spring_node.size(); ++s) {
            Sum& sum = sums[each->spring_node[s]];
            sum.stiffness += each->spring_stiffness.col(static_cast<Eigen::Index>(s));
            sum.force += each->spring_force.col(static_cast<Eigen::Index>(s));
        }
    conditions.spring_node.clear();
    conditions.spring_stiffness.resize(6, static_cast<Eigen::Index>(sums.size()));
    conditions.spring_force.resize(3, static_cast<Eigen::Index>(sums.size()));
    for (const auto& [node, sum] : sums) {
        const auto column = static_cast<Eigen::Index>(conditions.spring_node.size());
        conditions.spring_stiffness.col(column) = sum.stiffness;
        conditions.spring_force.col(column) = sum.force;
        conditions.spring_node.push_back(node);
    }
    return conditions;
}

NodalConditions scaled(NodalConditions conditions, double part) {
    conditions.spring_force *= part;
    conditions.imposed *= part;
    conditions.external_force *= part;
    conditions.effects.surface.pressure *= part;
    if (conditions.effects.fluid) conditions.effects.fluid->weight *= part;
    return conditions;
}

}  // namespace tissuewarp::tled
