#include "tled/rest_state.hpp"

#include "core/errors.hpp"

#include <Eigen/LU>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

namespace tissuewarp::tled {

namespace {

/// Materials without repetition in the order of their laws, and the index of each label's.
struct DistinctMaterials {
    std::vector<std::pair<Material, PronySeries>> materials;
    std::map<int, int> of_label;
};

PronySeries viscosity_of(const Model& model, int label) {
    const auto found = model.viscosity.find(label);
    return found == model.viscosity.end() ? PronySeries{} : found->second;
}

DistinctMaterials distinct_materials(const Model& model) {
    const std::set<int> labels(model.mesh.labels.begin(), model.mesh.labels.end());
    std::vector<int> by_law(labels.begin(), labels.end());
    std::stable_sort(by_law.begin(), by_law.end(),
                     [&](int a, int b) { return model.materials.at(a).index() < model.materials.at(b).index(); });
    DistinctMaterials result;
    for (const int label : by_law) {
        const std::pair material{model.materials.at(label), viscosity_of(model, label)};
        const auto place = std::find(result.materials.begin(), result.materials.end(), material);
        result.of_label[label] = static_cast<int>(place - result.materials.begin());
        if (place == result.materials.end()) result.materials.push_back(material);
    }
    return result;
}

void set_materials(const DistinctMaterials& distinct, RestState& rest) {
    bool viscous = false;
    for (const auto& [material, series] : distinct.materials) {
        rest.materials.push_back(material);
        rest.viscosity.push_back(series);
        viscous = viscous || !series.terms.empty();
    }
    if (!viscous) rest.viscosity.clear();
}

/// Groups elements by material, keeping the mesh's order within a group.
void order_by_material(const Eigen::VectorXi& labels, const std::map<int, int>& material_of_label, RestState& rest) {
    const auto material_of = [&](int element) { return material_of_label.at(labels[element]); };
    std::vector<int>& order = rest.tet;
    order.resize(static_cast<std::size_t>(labels.size()));
    std::iota(order.begin(), order.end(), 0);
    std::stable_sort(order.begin(), order.end(), [&](int a, int b) { return material_of(a) < material_of(b); });
    const int count = static_cast<int>(order.size());
    for (int begin = 0; begin < count;) {
        const int material = material_of(order[static_cast<std::size_t>(begin)]);
        int end = begin;
        while (end < count && material_of(order[static_cast<std::size_t>(end)]) == material) ++end;
        rest.blocks.push_back({material, begin, end});
        begin = end;
    }
}

/// Directions of the elements where the model has them, else of the material; zero in tissue without fibres.
Eigen::Matrix3Xd fibres(const Model& model, const RestState& rest) {
    const auto has_fibres = [](const Material& material) {
        return std::holds_alternative<TransverselyIsotropic>(material);
    };
    if (std::none_of(rest.materials.begin(), rest.materials.end(), has_fibres)) return {};
    Eigen::Matrix3Xd result = Eigen::Matrix3Xd::Zero(3, rest.element_count());
    for (const MaterialBlock& block : rest.blocks) {
        const auto* law = std::get_if<TransverselyIsotropic>(&rest.materials[static_cast<std::size_t>(block.material)]);
        if (law == nullptr) continue;
        for (int e = block.begin; e < block.end; ++e) {
            const int tet = rest.tet[static_cast<std::size_t>(e)];
            result.col(e) = model.fibre.size() > 0 ? Eigen::Vector3d(model.fibre.col(tet)) : law->fibre;
        }
    }
    return result;
}

void precompute_elements(const Model& model, RestState& rest) {
    const int count = rest.element_count();
    rest.nodes.resize(4, count);
    rest.gradient.resize(9, count);
    rest.volume.resize(count);
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

PressureNodes pressure_nodes(const RestState& rest) {
    PressureNodes pressure;
    pressure.of_element.resize(4, rest.element_count());
    const std::vector<int> material = material_of_elements(rest);
    std::map<std::pair<int, int>, int> index;  // (material, node) → pressure node
    const auto key = [&](int e, int corner) {
        return std::pair{material[static_cast<std::size_t>(e)], rest.nodes(corner, e)};
    };
    for (int e = 0; e < rest.element_count(); ++e)
        for (int corner = 0; corner < 4; ++corner) index.emplace(key(e, corner), 0);
    int count = 0;
    for (auto& [material_node, number] : index) {
        number = count++;
        pressure.material.push_back(material_node.first);
    }
    pressure.volume = Eigen::VectorXd::Zero(count);
    pressure.modulus.resize(count);
    for (int a = 0; a < count; ++a)
        pressure.modulus[a] = volumetric_modulus(
            rest.materials[static_cast<std::size_t>(pressure.material[static_cast<std::size_t>(a)])]);
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
    rest.position = model.mesh.nodes;
    const DistinctMaterials distinct = distinct_materials(model);
    set_materials(distinct, rest);
    order_by_material(model.mesh.labels, distinct.of_label, rest);
    precompute_elements(model, rest);
    rest.incidence = incidence_of(rest.nodes, rest.node_count);
    rest.fibre = fibres(model, rest);
    if ((rest.lumped_mass.array() <= 0).any())
        throw InvalidInput("the model's mesh has nodes that belong to no element; remove them");
    if (model.element == Element::AveragedPressureT4) rest.pressure = pressure_nodes(rest);
    return rest;
}

Element element_of(const RestState& rest) {
    return rest.pressure.count() > 0 ? Element::AveragedPressureT4 : Element::T4;
}

bool admits_inversion(const RestState& rest) {
    return std::all_of(rest.materials.begin(), rest.materials.end(),
                       [](const Material& material) { return admits_inversion(material); });
}

std::vector<int> material_of_elements(const RestState& rest) {
    std::vector<int> result;
    for (const MaterialBlock& block : rest.blocks) result.resize(static_cast<std::size_t>(block.end), block.material);
    return result;
}

}  // namespace tissuewarp::tled
