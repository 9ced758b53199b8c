#include "tled/detail/cpu_batches.hpp"

namespace tissuewarp::tled::detail {

namespace {

/// Writes rows of a per-element matrix in structure of arrays: batch × rows × width; nothing for a matrix without
/// columns.
template <class T, class Matrix>
std::vector<T> batched(const Matrix& matrix, const BatchLayout& layout) {
    if (matrix.cols() == 0) return {};
    const auto rows = static_cast<std::size_t>(matrix.rows());
    std::vector<T> result(layout.element.size() * rows);
    int last = 0;  // padding repeats the last element
    for (std::size_t s = 0; s < layout.element.size(); ++s) {
        if (layout.element[s] >= 0) last = layout.element[s];
        for (std::size_t k = 0; k < rows; ++k)
            result[(s / batch_width * rows + k) * batch_width + s % batch_width] =
                T(matrix(static_cast<Eigen::Index>(k), last));
    }
    return result;
}

/// One value per element, zero in padding.
template <class T>
std::vector<T> slotted(const Eigen::VectorXd& values, const BatchLayout& layout) {
    std::vector<T> result(layout.element.size(), T(0));
    for (std::size_t e = 0; e < layout.slot.size(); ++e)
        result[layout.slot[e]] = T(values[static_cast<Eigen::Index>(e)]);
    return result;
}

/// Record of an entry corners·element + corner of an incidence list.
std::uint32_t corner_record(const BatchLayout& layout, int entry, int corners) {
    const std::size_t slot = layout.slot[static_cast<std::size_t>(entry / corners)];
    const auto count = static_cast<std::size_t>(corners), corner = static_cast<std::size_t>(entry % corners);
    return static_cast<std::uint32_t>((slot / batch_width * count + corner) * batch_width + slot % batch_width);
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
ElementBatches<T> element_batches(const RestState& rest, const BatchLayout& layout) {
    ElementBatches<T> batches;
    batches.node = batched<std::int32_t>(record * rest.nodes, layout);
    batches.pressure = batched<std::int32_t>(rest.pressure.of_element, layout);
    batches.gradient = batched<T>(rest.gradient, layout);
    batches.fibre = batched<T>(rest.fibre, layout);
    batches.volume = slotted<T>(rest.volume, layout);
    batches.volumetric_modulus = slotted<T>(rest.volumetric_modulus, layout);
    return batches;
}

template <class T>
HexBatches<T> hex_batches(const HexState& hexahedra, const BatchLayout& layout) {
    HexBatches<T> batches;
    batches.node = batched<std::int32_t>(record * hexahedra.nodes, layout);
    batches.gradient = batched<T>(hexahedra.gradient, layout);
    batches.fibre = batched<T>(hexahedra.fibre, layout);
    batches.volume = slotted<T>(hexahedra.volume, layout);
    batches.volumetric_modulus = slotted<T>(hexahedra.volumetric_modulus, layout);
    batches.rest_hourglass = batched<T>(hexahedra.rest_hourglass, layout);
    batches.hourglass_stiffness = slotted<T>(hexahedra.hourglass_stiffness, layout);
    return batches;
}

template ElementBatches<float> element_batches(const RestState&, const BatchLayout&);
template ElementBatches<double> element_batches(const RestState&, const BatchLayout&);
template HexBatches<float> hex_batches(const HexState&, const BatchLayout&);
template HexBatches<double> hex_batches(const HexState&, const BatchLayout&);

std::vector<std::uint32_t> pressure_slots(const PressureNodes& pressure, const BatchLayout& layout) {
    std::vector<std::uint32_t> slots;
    slots.reserve(pressure.incidence.entry.size());
    for (const int entry : pressure.incidence.entry)
        slots.push_back(static_cast<std::uint32_t>(layout.slot[static_cast<std::size_t>(entry / 4)]));
    return slots;
}

ForceLists force_lists(const RestState& rest, const BatchLayout& tetrahedra, const BatchLayout& hexahedra) {
    const auto first_of_hexahedra = static_cast<std::uint32_t>(4 * tetrahedra.element.size());
    const Incidence &tets = rest.incidence, &hexes = rest.hexahedra.incidence;
    ForceLists lists{{0}, {}};
    lists.entry.reserve(tets.entry.size() + hexes.entry.size());
    for (std::size_t node = 0; node < static_cast<std::size_t>(rest.node_count); ++node) {
        for (int k = tets.offset[node]; k < tets.offset[node + 1]; ++k)
            lists.entry.push_back(corner_record(tetrahedra, tets.entry[static_cast<std::size_t>(k)], 4));
        if (!hexes.offset.empty())
            for (int k = hexes.offset[node]; k < hexes.offset[node + 1]; ++k)
                lists.entry.push_back(first_of_hexahedra +
                                      corner_record(hexahedra, hexes.entry[static_cast<std::size_t>(k)], 8));
        lists.offset.push_back(static_cast<int>(lists.entry.size()));
    }
    return lists;
}

}  // namespace tissuewarp::tled::detail
