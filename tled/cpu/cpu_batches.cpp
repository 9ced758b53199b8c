#include "tled/cpu/cpu_batches.hpp"

#include "tled/cpu/fan_layout.hpp"
#include "tled/material/kernel_parameters.hpp"

#include <algorithm>

namespace tissuewarp::tled::detail {

namespace {

/// Writes rows of a per-element matrix in structure of arrays: batch × rows × width; nothing for a matrix without
/// columns.
template <class Vector, class Matrix>
Vector batched(const Matrix& matrix, const BatchLayout& layout) {
    if (matrix.cols() == 0) return {};
    const auto rows = static_cast<std::size_t>(matrix.rows());
    Vector result(layout.element.size() * rows);
    int last = 0;  // padding repeats the last element
    for (std::size_t s = 0; s < layout.element.size(); ++s) {
        if (layout.element[s] >= 0) last = layout.element[s];
        for (std::size_t k = 0; k < rows; ++k)
            result[(s / batch_width * rows + k) * batch_width + s % batch_width] =
                static_cast<typename Vector::value_type>(matrix(static_cast<Eigen::Index>(k), last));
    }
    return result;
}

/// One value per element, zero in padding.
template <class T>
AlignedVector<T> slotted(const Eigen::VectorXd& values, const BatchLayout& layout) {
    AlignedVector<T> result(layout.element.size(), T(0));
    for (std::size_t e = 0; e < layout.slot.size(); ++e)
        result[layout.slot[e]] = T(values[static_cast<Eigen::Index>(e)]);
    return result;
}

/// Four times the internal numbers of nodes.
template <class Matrix>
Eigen::MatrixXi record_offsets(const Matrix& nodes, const std::vector<std::uint32_t>& internal) {
    return nodes.unaryExpr(
        [&](int node) { return record * static_cast<int>(internal[static_cast<std::size_t>(node)]); });
}

/// The same matrices with each element's corners in the order of its fan.
Eigen::Matrix4Xi turned_nodes(const RestState& rest, const FanLayout& layout) {
    Eigen::Matrix4Xi nodes(4, rest.element_count());
    for (int e = 0; e < rest.element_count(); ++e)
        for (int c = 0; c < 4; ++c)
            nodes(c, e) = rest.nodes(layout.corner[static_cast<std::size_t>(e)][static_cast<std::size_t>(c)], e);
    return nodes;
}

Eigen::Matrix<double, 9, Eigen::Dynamic> turned_gradients(const RestState& rest, const FanLayout& layout) {
    Eigen::Matrix<double, 9, Eigen::Dynamic> turned(9, rest.element_count());
    for (int e = 0; e < rest.element_count(); ++e) {
        Eigen::Matrix<double, 3, 4> all;
        all.rightCols<3>() = rest.gradient.col(e).reshaped(3, 3);
        all.col(0) = -all.rightCols<3>().rowwise().sum();
        for (int c = 1; c < 4; ++c)
            turned.col(e).segment<3>(3 * (c - 1)) =
                all.col(layout.corner[static_cast<std::size_t>(e)][static_cast<std::size_t>(c)]);
    }
    return turned;
}

/// Places of records instead of scalars.
template <class T>
std::vector<std::uint16_t> record_places(const std::vector<std::uint16_t>& places) {
    std::vector<std::uint16_t> result(places.size());
    std::transform(places.begin(), places.end(), result.begin(), [](std::uint16_t place) {
        const std::size_t lane = place % batch_width;
        return static_cast<std::uint16_t>(place - lane + place_of_record<T>(lane));
    });
    return result;
}

SourceLists joined(const std::vector<std::vector<std::uint32_t>>& sources) {
    SourceLists lists{{0}, {}};
    for (const std::vector<std::uint32_t>& of_one : sources) {
        lists.entry.insert(lists.entry.end(), of_one.begin(), of_one.end());
        lists.offset.push_back(static_cast<std::uint32_t>(lists.entry.size()));
    }
    return lists;
}

}  // namespace

BatchLayout batch_layout(const std::vector<MaterialBlock>& blocks) {
    BatchLayout layout;
    for (const MaterialBlock& block : blocks) {
        const std::size_t begin = layout.element.size() / batch_width;
        for (int e = block.begin; e < block.end; ++e) {
            layout.slot.push_back(layout.element.size());
            layout.element.push_back(e);
        }
        while (layout.element.size() % batch_width != 0) layout.element.push_back(-1);
        layout.blocks.push_back({block.material, begin, layout.element.size() / batch_width});
    }
    return layout;
}

template <class T>
ElementBatches<T> element_batches(const RestState& rest, const FanLayout& layout) {
    ElementBatches<T> batches;
    batches.nodes = layout.nodes;
    batches.nodes.record_place = record_places<T>(layout.nodes.scalar_place);
    if (rest.pressure.count() == 0) batches.nodes.scalar_place.clear();
    batches.groups = layout.groups;
    batches.patches = layout.patches;
    for (const FanPatch& patch : batches.patches) {
        const FanGroup& last = batches.groups[patch.end_group - 1];
        const std::size_t places = last.first_place + static_cast<std::size_t>(last.length + 3) * batch_width;
        batches.most_nodes = std::max(batches.most_nodes, patch.node_count);
        batches.most_places = std::max(batches.most_places, places);
    }
    batches.node =
        batched<std::vector<std::int32_t>>(record_offsets(turned_nodes(rest, layout), layout.internal), layout.batches);
    batches.gradient = batched<AlignedVector<T>>(turned_gradients(rest, layout), layout.batches);
    batches.fibre = batched<AlignedVector<T>>(rest.fibre, layout.batches);
    batches.volume = slotted<T>(rest.volume, layout.batches);
    batches.volumetric_modulus = slotted<T>(rest.volumetric_modulus, layout.batches);
    return batches;
}

template <class T>
HexBatches<T> hex_batches(const HexState& hexahedra, const BatchLayout& layout,
                          const std::vector<std::uint32_t>& internal) {
    HexBatches<T> batches;
    batches.node = batched<std::vector<std::int32_t>>(record_offsets(hexahedra.nodes, internal), layout);
    batches.gradient = batched<AlignedVector<T>>(hexahedra.gradient, layout);
    batches.fibre = batched<AlignedVector<T>>(hexahedra.fibre, layout);
    batches.volume = slotted<T>(hexahedra.volume, layout);
    batches.volumetric_modulus = slotted<T>(hexahedra.volumetric_modulus, layout);
    batches.rest_hourglass = batched<AlignedVector<T>>(hexahedra.rest_hourglass, layout);
    batches.hourglass_stiffness = slotted<T>(hexahedra.hourglass_stiffness, layout);
    return batches;
}

template ElementBatches<float> element_batches(const RestState&, const FanLayout&);
template ElementBatches<double> element_batches(const RestState&, const FanLayout&);
template HexBatches<float> hex_batches(const HexState&, const BatchLayout&, const std::vector<std::uint32_t>&);
template HexBatches<double> hex_batches(const HexState&, const BatchLayout&, const std::vector<std::uint32_t>&);

template <class T>
std::vector<KernelMaterial<T>> kernel_materials(const RestState& rest) {
    std::vector<KernelMaterial<T>> result;
    for (const Material& material : rest.materials) {
        KernelMaterial<T> entry{material.index(), {}};
        const KernelParameters parameters = kernel_parameters(material);
        std::transform(parameters.begin(), parameters.end(), entry.parameter.begin(), [](double p) { return T(p); });
        result.push_back(entry);
    }
    return result;
}

template std::vector<KernelMaterial<float>> kernel_materials(const RestState&);
template std::vector<KernelMaterial<double>> kernel_materials(const RestState&);

SourceLists pressure_sources(const PressureNodes& pressure, const FanLayout& layout) {
    std::vector<std::vector<std::uint32_t>> sources(static_cast<std::size_t>(pressure.count()));
    for (std::size_t i = 0; i < layout.nodes.pressure.size(); ++i)
        sources[layout.nodes.pressure[i]].push_back(static_cast<std::uint32_t>(i));
    return joined(sources);
}

SourceLists force_sources(const RestState& rest, const FanLayout& layout, const BatchLayout& hexahedra) {
    const auto hex_records = static_cast<std::uint32_t>(layout.nodes.node.size());
    std::vector<std::vector<std::uint32_t>> sources(layout.mesh_node.size() - layout.own_nodes);
    for (std::size_t i = 0; i < layout.nodes.node.size(); ++i)
        if (layout.nodes.node[i] >= layout.own_nodes)
            sources[layout.nodes.node[i] - layout.own_nodes].push_back(static_cast<std::uint32_t>(i));
    const HexState& hexes = rest.hexahedra;
    for (int e = 0; e < hexes.count(); ++e)
        for (int corner = 0; corner < 8; ++corner) {
            const std::size_t node = layout.internal[static_cast<std::size_t>(hexes.nodes(corner, e))];
            const std::size_t slot = hexahedra.slot[static_cast<std::size_t>(e)];
            const std::size_t first = (slot / batch_width * 8 + static_cast<std::size_t>(corner)) * batch_width;
            sources[node - layout.own_nodes].push_back(hex_records +
                                                       static_cast<std::uint32_t>(first + slot % batch_width));
        }
    return joined(sources);
}

}  // namespace tissuewarp::tled::detail
