#include "tled/gpu/gpu_effect_layout.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <bit>

namespace tissuewarp::tled::detail {
namespace {

using Eigen::Matrix3Xd;
using Eigen::Vector3d;
using Words = std::vector<std::uint32_t>;

std::uint32_t place(std::size_t at) {
    return static_cast<std::uint32_t>(at);
}

void put_node(Words& words, int node) {
    words.push_back(static_cast<std::uint32_t>(node));
}

void put(Words& words, double value) {
    words.push_back(std::bit_cast<std::uint32_t>(single(value)));
}

void put(Words& words, const Vector3d& vector) {
    for (const double value : vector) put(words, value);
}

/// Lists of records of all nodes, one for each entry; gives their place, 0 where there are no entries. `record(entry)`
/// appends one.
template <class Record>
std::uint32_t append_lists(Words& words, const Incidence& incidence, const Record& record) {
    if (incidence.entry.empty()) return 0;
    const std::size_t lists = words.size(), nodes = incidence.offset.size() - 1;
    words.resize(lists + nodes + 1);
    for (std::size_t s = 0; s < nodes; ++s) {
        words[lists + s] = place(words.size());
        for (int k = incidence.offset[s]; k < incidence.offset[s + 1]; ++k)
            record(incidence.entry[static_cast<std::size_t>(k)]);
    }
    words[lists + nodes] = place(words.size());
    return place(lists);
}

/// A face from one of its corners: the other two nodes in its order, the edges to them.
struct Corner {
    int b, c;
    Vector3d to_b, to_c;  // mm
};

/// `entry` is 3·face + corner.
Corner corner_of(const Eigen::Matrix3Xi& faces, int entry, const Matrix3Xd& position) {
    const auto node = [&](int k) { return faces((entry % 3 + k) % 3, entry / 3); };
    const Vector3d a = position.col(node(0));
    return {node(1), node(2), position.col(node(1)) - a, position.col(node(2)) - a};
}

/// As SurfaceEffects::membrane_rest has it for the first corner.
Vector3d rest_map(const Corner& corner) {
    const double a = corner.to_b.norm(), b = corner.to_b.dot(corner.to_c) / a,
                 c = corner.to_b.cross(corner.to_c).norm() / a;
    return {1 / a, -b / (a * c), 1 / c};
}

void put_obstacle(Words& words, const Obstacle& obstacle, const GridReach& reach, const Vector3d& common_point,
                  std::uint32_t first_sample) {
    const DistanceGrid& grid = *obstacle.surface;
    const auto& [shift, rotation] = obstacle.placement;
    const Eigen::Matrix3d to_grid = grid.steps.inverse() * rotation.transpose();
    for (int row = 0; row < 3; ++row) put(words, to_grid.row(row).transpose().eval());
    put(words, (rotation * grid.origin + shift - common_point).eval());
    for (const int size : grid.size) put_node(words, size);
    words.push_back(first_sample);
    put(words, reach.interpolation);
    put(words, obstacle.friction);
    put(words, 1 / reach.steepness);
    put(words, std::min(reach.tangent, 1e3));
    const auto& [of_origin, spin] = obstacle.velocity;
    put(words, (of_origin + spin.cross(common_point)).eval());
    put(words, spin);
}
constexpr std::size_t obstacle_words = 26;

}  // namespace

Words gpu_springs(const NodalConditions& conditions, int node_count) {
    Words words(static_cast<std::size_t>(node_count), 0U);
    for (std::size_t s = 0; s < conditions.spring_node.size(); ++s) {
        const auto column = static_cast<Eigen::Index>(s);
        words[static_cast<std::size_t>(conditions.spring_node[s])] = place(words.size());
        for (const double k : conditions.spring_stiffness.col(column)) put(words, k);
        put(words, conditions.spring_force.col(column).eval());
    }
    return words;
}

GpuSurface gpu_surface(const SurfaceEffects& effects, const Matrix3Xd& position) {
    GpuSurface surface;
    Words& words = surface.words;
    for (const int node : effects.node) put_node(words, node);
    surface.pressure_lists = append_lists(words, effects.pressure_incidence, [&](int entry) {
        const Corner corner = corner_of(effects.pressure_faces, entry, position);
        put_node(words, corner.b);
        put_node(words, corner.c);
        put(words, effects.pressure[entry / 3] / 6);
        put(words, corner.to_b);
        put(words, corner.to_c);
    });
    surface.membrane_lists = append_lists(words, effects.membrane_incidence, [&](int entry) {
        const Corner corner = corner_of(effects.membrane_faces, entry, position);
        const Vector3d to_rest = rest_map(corner);
        put_node(words, corner.b);
        put_node(words, corner.c);
        put(words, effects.membrane_stiffness[entry / 3]);
        put(words, to_rest);
        put(words, (to_rest[0] * corner.to_b).eval());
        put(words, (to_rest[1] * corner.to_b + to_rest[2] * corner.to_c).eval());
    });
    surface.sliding_lists = append_lists(words, effects.sliding_incidence, [&](int entry) {
        const SlidingPair& pair = effects.sliding[static_cast<std::size_t>(entry / 2)];
        put_node(words, entry % 2 == 0 ? pair.second : pair.first);
        put(words, pair.stiffness);
        put(words, pair.normal);
    });
    surface.parting_lists = append_lists(words, effects.parting_incidence, [&](int entry) {
        const SlidingPair& pair = effects.parting[static_cast<std::size_t>(entry / 2)];
        const bool first = entry % 2 == 0;
        put_node(words, first ? pair.second : pair.first);
        put(words, pair.stiffness);
        put(words, first ? pair.normal : Vector3d(-pair.normal));
    });
    return surface;
}

std::vector<Float4> gpu_fluid(const NodalFluid& fluid) {
    std::vector<Float4> columns{{single(fluid.up[0]), single(fluid.up[1]), single(fluid.up[2]), 0.0F}};
    for (Eigen::Index a = 0; a < fluid.weight.size(); ++a) {
        // A node without volume displaces nothing, and its column has no height to divide by.
        if (!(fluid.weight[a] > 0)) {
            columns.push_back({0.0F, 0.0F, 0.0F, 0.0F});
            continue;
        }
        const double depth = fluid.level - fluid.rest_height[a], height = fluid.column_height[a];
        columns.push_back({single(0.5 + depth / height), single(1 / height), single(fluid.weight[a]), 0.0F});
    }
    return columns;
}

namespace {

/// Place of the first rest position.
std::size_t first_position(const NodalContact& contact, int node_count) {
    return 1 + obstacle_words * contact.obstacles.size() + static_cast<std::size_t>(node_count);
}

Vector3d common_point(const NodalContact& contact) {
    return contact.rest_position.rowwise().mean();
}

}  // namespace

Words gpu_obstacles(const NodalContact& contact, int node_count) {
    Words words{place(contact.obstacles.size())};
    std::size_t first_sample = first_position(contact, node_count) + 3 * contact.node.size();
    for (std::size_t o = 0; o < contact.obstacles.size(); ++o) {
        put_obstacle(words, contact.obstacles[o], contact.reach[o], common_point(contact), place(first_sample));
        first_sample += contact.obstacles[o].surface->distance.size();
    }
    return words;
}

Words gpu_contact(const NodalContact& contact, int node_count) {
    Words words = gpu_obstacles(contact, node_count);
    const std::size_t places = words.size();
    words.resize(first_position(contact, node_count), 0U);
    for (std::size_t i = 0; i < contact.node.size(); ++i) {
        words[places + static_cast<std::size_t>(contact.node[i])] = place(words.size());
        put(words, (contact.rest_position.col(static_cast<Eigen::Index>(i)) - common_point(contact)).eval());
    }
    for (const Obstacle& obstacle : contact.obstacles)
        for (const float sample : obstacle.surface->distance) words.push_back(std::bit_cast<std::uint32_t>(sample));
    return words;
}

}  // namespace tissuewarp::tled::detail
