#pragma once
/// The rest state in the padded batches of the CPU kernels, and the lists by which nodes gather what these leave.

#include "tled/cpu/cpu_kernels.hpp"
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

struct FanLayout;

template <class T>
ElementBatches<T> element_batches(const RestState& rest, const FanLayout& layout);

/// What the kernels know of each of RestState::materials.
template <class T>
std::vector<KernelMaterial<T>> kernel_materials(const RestState& rest);

/// What is summed for each of a row of nodes: `entry` from offset[i] to offset[i + 1].
struct SourceLists {
    std::vector<std::uint32_t> offset, entry;
};

/// Patch × local node, for each pressure node.
SourceLists pressure_sources(const PressureNodes& pressure, const FanLayout& layout);

/// For each internal node that is no patch's own: patch × local node.
SourceLists force_sources(const FanLayout& layout);

}  // namespace tissuewarp::tled::detail
