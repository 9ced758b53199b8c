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

/// Four times the internal numbers of each element's nodes, in the order of its fan.
Eigen::Matrix4Xi record_offsets(const RestState& rest, const FanLayout& layout) {
    Eigen::Matrix4Xi offsets(4, rest.element_count());
    for (int e = 0; e < rest.element_count(); ++e)
        for (int c = 0; c < 4; ++c) {
            const int corner = layout.corner[static_cast<std::size_t>(e)][static_cast<std::size_t>(c)];
            const auto node = static_cast<std::size_t>(rest.nodes(corner, e));
            offsets(c, e) = record * static_cast<int>(layout.internal[node]);
        }
    return offsets;
}

/// ∇N with the corners in the same order.
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
    batches.node = batched<std::vector<std::int32_t>>(record_offsets(rest, layout), layout.batches);
    batches.gradient = batched<AlignedVector<T>>(turned_gradients(rest, layout), layout.batches);
    batches.fibre = batched<AlignedVector<T>>(rest.fibre, layout.batches);
    batches.volume = slotted<T>(rest.volume, layout.batches);
    batches.volumetric_modulus = slotted<T>(rest.volumetric_modulus, layout.batches);
    return batches;
}

template ElementBatches<float> element_batches(const RestState&, const FanLayout&);
template ElementBatches<double> element_batches(const RestState&, const FanLayout&);

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

SourceLists force_sources(const FanLayout& layout) {
    std::vector<std::vector<std::uint32_t>> sources(layout.mesh_node.size() - layout.own_nodes);
    for (std::size_t i = 0; i < layout.nodes.node.size(); ++i)
        if (layout.nodes.node[i] >= layout.own_nodes)
            sources[layout.nodes.node[i] - layout.own_nodes].push_back(static_cast<std::uint32_t>(i));
    return joined(sources);
}

}  // namespace tissuewarp::tled::detail
