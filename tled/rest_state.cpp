#include "tled/rest_state.hpp"

#include "core/errors.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <map>
#include <numeric>

namespace tissuewarp::tled {

namespace {

/// Groups tetrahedra by the alternative of their material, keeping the mesh's order within a group.
void order_by_law(const Model& model, RestState& rest) {
    const auto law_of = [&](int tet) { return model.materials.at(model.mesh.labels[tet]).index(); };
    rest.tet.resize(static_cast<std::size_t>(model.mesh.tet_count()));
    std::iota(rest.tet.begin(), rest.tet.end(), 0);
    std::stable_sort(rest.tet.begin(), rest.tet.end(), [&](int a, int b) { return law_of(a) < law_of(b); });
    const int count = rest.element_count();
    for (int begin = 0; begin < count;) {
        const std::size_t law = law_of(rest.tet[static_cast<std::size_t>(begin)]);
        int end = begin;
        while (end < count && law_of(rest.tet[static_cast<std::size_t>(end)]) == law) ++end;
        rest.blocks.push_back({law, begin, end});
        begin = end;
    }
}

void precompute_elements(const Model& model, RestState& rest) {
    const int count = rest.element_count();
    rest.nodes.resize(4, count);
    rest.gradient.resize(9, count);
    rest.volume.resize(count);
    rest.shear_modulus.resize(count);
    rest.volumetric_modulus.resize(count);
    rest.lumped_mass = Eigen::VectorXd::Zero(model.mesh.node_count());
    const bool averaged = model.element == Element::AveragedPressureT4;
    for (int e = 0; e < count; ++e) {
        const int tet = rest.tet[static_cast<std::size_t>(e)];
        const Eigen::Vector4i nodes = model.mesh.tets.col(tet);
        rest.nodes.col(e) = nodes;
        Eigen::Matrix3d edges;  // columns X_k − X_0
        for (int k = 0; k < 3; ++k) edges.col(k) = model.mesh.nodes.col(nodes[k + 1]) - model.mesh.nodes.col(nodes[0]);
        // N_k(X) are barycentric coordinates: row k of edges⁻¹ is ∂N_{k+1}/∂X.
        const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> gradient = edges.inverse();
        rest.gradient.col(e) = Eigen::Map<const Eigen::Matrix<double, 9, 1>>(gradient.data());
        rest.volume[e] = edges.determinant() / 6;
        const Material& material = model.materials.at(model.mesh.labels[tet]);
        rest.shear_modulus[e] = shear_modulus(material);
        rest.volumetric_modulus[e] = averaged ? 0.0 : volumetric_modulus(material);
        for (const int node : nodes) rest.lumped_mass[node] += model.density * rest.volume[e] / 4;
    }
}

Incidence incidence_of(const Eigen::Matrix4Xi& of_element, int count) {
    Incidence lists;
    lists.offset.assign(static_cast<std::size_t>(count) + 1, 0);
    for (const int target : of_element.reshaped()) ++lists.offset[static_cast<std::size_t>(target) + 1];
    std::partial_sum(lists.offset.begin(), lists.offset.end(), lists.offset.begin());
    lists.entry.resize(static_cast<std::size_t>(of_element.size()));
    std::vector<int> next(lists.offset.begin(), lists.offset.end() - 1);
    for (int i = 0; i < static_cast<int>(of_element.size()); ++i) {
        const int target = of_element.data()[i];
        lists.entry[static_cast<std::size_t>(next[static_cast<std::size_t>(target)]++)] = i;
    }
    return lists;
}

PressureNodes pressure_nodes(const Model& model, const RestState& rest) {
    PressureNodes pressure;
    pressure.of_element.resize(4, rest.element_count());
    std::map<std::pair<int, int>, int> index;  // (node, label) → pressure node, numbered in node order
    const auto key = [&](int e, int corner) {
        return std::pair{rest.nodes(corner, e), model.mesh.labels[rest.tet[static_cast<std::size_t>(e)]]};
    };
    for (int e = 0; e < rest.element_count(); ++e)
        for (int corner = 0; corner < 4; ++corner) index.emplace(key(e, corner), 0);
    int count = 0;
    for (auto& [node_label, number] : index) number = count++;
    pressure.volume = Eigen::VectorXd::Zero(count);
    pressure.modulus.resize(count);
    pressure.law.resize(index.size());
    for (const auto& [node_label, number] : index) {
        const Material& material = model.materials.at(node_label.second);
        pressure.modulus[number] = volumetric_modulus(material);
        pressure.law[static_cast<std::size_t>(number)] = material.index();
    }
    for (int e = 0; e < rest.element_count(); ++e)
        for (int corner = 0; corner < 4; ++corner) {
            const int number = index.at(key(e, corner));
            pressure.of_element(corner, e) = number;
            pressure.volume[number] += rest.volume[e] / 4;
        }
    pressure.incidence = incidence_of(pressure.of_element, count);
    return pressure;
}

}  // namespace

RestState rest_state(const Model& model) {
    require_valid(model);
    RestState rest;
    rest.node_count = model.mesh.node_count();
    order_by_law(model, rest);
    precompute_elements(model, rest);
    if ((rest.lumped_mass.array() <= 0).any())
        throw InvalidInput("the model's mesh has nodes that belong to no tetrahedron; remove them");
    rest.incidence = incidence_of(rest.nodes, rest.node_count);
    if (model.element == Element::AveragedPressureT4) rest.pressure = pressure_nodes(model, rest);
    return rest;
}

}  // namespace tissuewarp::tled
