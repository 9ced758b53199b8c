#pragma once
/// The rest state in the padded batches of the CPU kernels, and the lists by which nodes gather what these leave.

#include "tled/detail/cpu_kernels.hpp"
#include "tled/rest_state.hpp"

#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

struct BatchBlock {
    int material;            ///< of RestState::materials
    std::size_t begin, end;  ///< batches
};

/// Position of the elements of an internal order in the padded batches.
struct BatchLayout {
    std::vector<BatchBlock> blocks;
    std::vector<std::size_t> slot;  ///< element → batch·width + lane
    std::vector<int> element;       ///< slot → element, −1 for padding
};
BatchLayout batch_layout(const std::vector<MaterialBlock>& blocks);

template <class T>
ElementBatches<T> element_batches(const RestState& rest, const BatchLayout& layout);
template <class T>
HexBatches<T> hex_batches(const HexState& hexahedra, const BatchLayout& layout);

/// Slots of the tetrahedra of each pressure node.
std::vector<std::uint32_t> pressure_slots(const PressureNodes& pressure, const BatchLayout& layout);

/// Corner-force records that the nodes gather: of their tetrahedra, then of their hexahedra, whose records follow.
struct ForceLists {
    std::vector<int> offset;
    std::vector<std::uint32_t> entry;
};
ForceLists force_lists(const RestState& rest, const BatchLayout& tetrahedra, const BatchLayout& hexahedra);

}  // namespace tissuewarp::tled::detail
