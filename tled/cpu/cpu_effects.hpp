#pragma once
/// Effects (nodal_effects.hpp) by the internal numbers of the CPU engine. Nodal vectors are records.

#include "tled/cpu/cpu_kernels.hpp"
#include "tled/nodal_effects.hpp"
#include "tled/parallel/parallel.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::tled::detail {

/// The part of a list sorted by internal node that belongs to [begin, end).
template <class List>
auto of_nodes(List& list, std::size_t begin, std::size_t end) {
    using Entry = typename List::value_type;
    const auto before = [](const Entry& each, std::size_t node) { return each.node < node; };
    const auto first = std::lower_bound(list.begin(), list.end(), begin, before);
    const auto last = std::lower_bound(first, list.end(), end, before);
    return std::pair{list.data() + (first - list.begin()), list.data() + (last - list.begin())};
}

/// Pressures, membranes and sliding pairs. Every node sums what its own faces and pairs do to it, in a fixed order.
template <class T>
class CpuSurface {
    using Vector = Eigen::Matrix<T, 3, 1>;
    using Edges = Eigen::Matrix<T, 3, 2>;
    using Matrix2 = Eigen::Matrix<T, 2, 2>;

public:
    CpuSurface(const SurfaceEffects& effects, const Eigen::Matrix3Xd& position,
               const std::vector<std::uint32_t>& internal)
        : effects_(effects), internal_(internal), force_(effects.node.size()) {
        for (Eigen::Index f = 0; f < effects.pressure_faces.cols(); ++f)
            pressure_edges_.push_back(rest_edges(position, effects.pressure_faces.col(f)).template cast<T>());
        for (Eigen::Index f = 0; f < effects.membrane_faces.cols(); ++f) {
            const auto d = effects.membrane_rest.col(f);
            const Eigen::Matrix2d to_rest{{d[0], d[1]}, {0, d[2]}};
            membrane_map_.push_back(to_rest.cast<T>());
            membrane_basis_.push_back(
                (rest_edges(position, effects.membrane_faces.col(f)) * to_rest).template cast<T>());
        }
        tension_.resize(membrane_map_.size());
        for (std::size_t i = 0; i < effects.node.size(); ++i)
            place_.push_back({internal[static_cast<std::size_t>(effects.node[i])], i});
        std::sort(place_.begin(), place_.end(), [](const Place& x, const Place& y) { return x.node < y.node; });
    }

    [[nodiscard]] std::size_t nodes() const { return force_.size(); }
    /// Which of the effects there are.
    [[nodiscard]] std::vector<std::string> parts() const {
        std::vector<std::string> names;
        if (!pressure_edges_.empty()) names.push_back("pressure");
        if (!tension_.empty()) names.push_back("membrane");
        if (!effects_.sliding.empty()) names.push_back("sliding");
        if (!effects_.parting.empty()) names.push_back("parting");
        return names;
    }

    /// Forces at displacement `u`, mN, to be taken off once no node has moved yet.
    void evaluate(const T* u) {
        parallel_ranges(0, tension_.size(), 256, [&](std::size_t begin, std::size_t end) {
            for (std::size_t f = begin; f != end; ++f) tension_[f] = tension(f, u);
        });
        parallel_ranges(0, force_.size(), 256, [&](std::size_t begin, std::size_t end) {
            for (std::size_t i = begin; i != end; ++i) force_[i] = force_on(i, u);
        });
    }

    /// Takes the forces on internal nodes [begin, end) off `force`, mN.
    void take_off(std::size_t begin, std::size_t end, T* force) const {
        const auto [first, last] = of_nodes(place_, begin, end);
        for (const Place* place = first; place != last; ++place)
            for (int c = 0; c < 3; ++c)
                force[place->node * std::size_t{record} + static_cast<std::size_t>(c)] -= force_[place->entry][c];
    }

private:
    struct Place {
        std::uint32_t node;  // internal
        std::size_t entry;
    };

    static Eigen::Matrix<double, 3, 2> rest_edges(const Eigen::Matrix3Xd& X, const Eigen::Vector3i& face) {
        return (Eigen::Matrix<double, 3, 2>() << X.col(face[1]) - X.col(face[0]), X.col(face[2]) - X.col(face[0]))
            .finished();
    }

    [[nodiscard]] Vector at(const T* u, int node) const {
        return Eigen::Map<const Vector>(u + internal_[static_cast<std::size_t>(node)] * std::size_t{record});
    }

    [[nodiscard]] Edges stretch(const T* u, const Eigen::Vector3i& face) const {
        const Vector origin = at(u, face[0]);
        return (Edges() << at(u, face[1]) - origin, at(u, face[2]) - origin).finished();
    }

    template <class Body>
    static void for_entries(const Incidence& incidence, std::size_t i, const Body& body) {
        for (int k = incidence.offset[i]; k < incidence.offset[i + 1]; ++k)
            body(incidence.entry[static_cast<std::size_t>(k)]);
    }

    [[nodiscard]] Vector force_on(std::size_t i, const T* u) const {
        Vector force = Vector::Zero();
        for_entries(effects_.pressure_incidence, i, [&](int entry) { force += pressure_on(entry / 3, u); });
        for_entries(effects_.membrane_incidence, i, [&](int entry) { force += tension_on(entry / 3, entry % 3); });
        for_entries(effects_.sliding_incidence, i, [&](int entry) {
            const SlidingPair& pair = effects_.sliding[static_cast<std::size_t>(entry / 2)];
            force += pull_on(pair, entry % 2, overlap_of(pair, u));
        });
        for_entries(effects_.parting_incidence, i, [&](int entry) {
            const SlidingPair& pair = effects_.parting[static_cast<std::size_t>(entry / 2)];
            force += pull_on(pair, entry % 2, std::max(overlap_of(pair, u), T(0)));
        });
        return force;
    }

    [[nodiscard]] Vector pressure_on(int f, const T* u) const {
        const Edges e = pressure_edges_[static_cast<std::size_t>(f)] + stretch(u, effects_.pressure_faces.col(f));
        return -T(effects_.pressure[f] / 6) * e.col(0).cross(e.col(1));
    }

    /// Internal forces of corners 1 and 2, as columns; that of corner 0 is the rest to zero. P = μ F (I − C⁻¹/det C),
    /// with F = Q + H and C = I + A written such that nothing cancels near rest: with d = tr A + det A, the bracket is
    /// ((d (2 + d) − tr A) I + A) / (1 + d)².
    [[nodiscard]] Edges tension(std::size_t face, const T* u) const {
        const auto f = static_cast<Eigen::Index>(face);
        const Edges& Q = membrane_basis_[face];
        const Matrix2& to_rest = membrane_map_[face];
        const Edges H = stretch(u, effects_.membrane_faces.col(f)) * to_rest;
        const Matrix2 QH = Q.transpose() * H;
        const Matrix2 A = QH + QH.transpose() + H.transpose() * H;
        const T trace = A.trace(), d = trace + A.determinant();
        const Matrix2 bracket = ((d * (2 + d) - trace) * Matrix2::Identity() + A) / ((1 + d) * (1 + d));
        return T(effects_.membrane_stiffness[f]) * ((Q + H) * bracket) * to_rest.transpose();
    }

    [[nodiscard]] Vector tension_on(int f, int corner) const {
        const Edges& internal = tension_[static_cast<std::size_t>(f)];
        if (corner == 0) return internal.rowwise().sum();
        return -internal.col(corner - 1);
    }

    [[nodiscard]] T overlap_of(const SlidingPair& pair, const T* u) const {
        return pair.normal.cast<T>().dot(at(u, pair.first) - at(u, pair.second));
    }

    /// Of a pair that overlaps by g.
    [[nodiscard]] static Vector pull_on(const SlidingPair& pair, int second, T g) {
        const Vector pull = T(pair.stiffness) * g * pair.normal.cast<T>();
        return second == 0 ? Vector(-pull) : pull;
    }

    SurfaceEffects effects_;
    const std::vector<std::uint32_t>& internal_;
    std::vector<Edges> pressure_edges_, membrane_basis_;
    std::vector<Matrix2> membrane_map_;
    std::vector<Edges> tension_;  // of each membrane face
    std::vector<Vector> force_;   // by entry of SurfaceEffects::node
    std::vector<Place> place_;    // ascending by node
};

template <class T>
class CpuFluid {
public:
    CpuFluid(const NodalFluid& fluid, const std::vector<std::uint32_t>& internal)
        : up_{T(fluid.up[0]), T(fluid.up[1]), T(fluid.up[2])}, column_(internal.size()) {
        for (std::size_t node = 0; node < internal.size(); ++node) {
            const auto a = static_cast<Eigen::Index>(node);
            column_[internal[node]] = {T((fluid.level - fluid.rest_height[a]) / fluid.column_height[a]),
                                       T(1 / fluid.column_height[a]), T(fluid.weight[a])};
        }
    }

    /// Takes the lift of nodes [begin, end) at displacement `u` off `force`, mN.
    void take_off(const T* u, std::size_t begin, std::size_t end, T* force) const {
        for (std::size_t node = begin; node != end; ++node) {
            const Column& c = column_[node];
            const T* at = u + node * record;
            const T rise = up_[0] * at[0] + up_[1] * at[1] + up_[2] * at[2];
            const T lift = c.weight * std::clamp(T(0.5) + c.depth - rise * c.inverse_height, T(0), T(1));
            for (std::size_t i = 0; i < 3; ++i) force[node * record + i] -= lift * up_[i];
        }
    }

private:
    struct Column {
        T depth = 0, inverse_height = 0, weight = 0;  // depth at rest in column heights; 1/mm; mN
    };
    std::array<T, 3> up_;
    std::vector<Column> column_;  // by internal node
};

}  // namespace tissuewarp::tled::detail
