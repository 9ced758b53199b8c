#pragma once
/// The inner loops of the CPU engine, compiled once per instruction set and chosen at run time (Highway). T is float or
/// double.

#include <oneapi/tbb/cache_aligned_allocator.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

/// Elements are stored in batches of `batch_width`, structure of arrays within a batch; a batch is padded with copies
/// of its last element that have zero volume.
inline constexpr int batch_width = 16;

enum class Kinematics { T4, AveragedPressure };

/// Nodal vectors are records of four numbers (x, y, z, 0), so that a node is one load.
inline constexpr int record = 4;

/// Vectors of the widest instruction set must not straddle cache lines.
template <class T>
using AlignedVector = std::vector<T, tbb::cache_aligned_allocator<T>>;

/// Tetrahedra (a, b, c_k, c_{k+1}), one batch for each k < length, of batch_width fans around edges a b.
struct FanGroup {
    std::size_t first_batch;
    std::size_t first_place;  ///< of a, b, c_0 … c_length, batch_width each, from the patch's FanPatch::first_fan_node
    int length;
};

/// What one thread computes at a time: tetrahedra of one material whose nodes and forces stay in its cache.
struct FanPatch {
    std::size_t material;  ///< of RestState::materials
    std::size_t first_group, end_group;
    std::size_t first_fan_node;
    std::size_t first_node, node_count;  ///< of PatchNodes
    std::size_t first_own, own_count;    ///< internal numbers of the first nodes, which no other patch moves
};

/// Places are where a patch's fans leave what they add to their nodes, in the order of `fan_node`; those of a node are
/// `place` from place_begin[i] to place_begin[i + 1].
struct PatchNodes {
    std::vector<std::uint16_t> fan_node;      ///< group × (length + 3) × width: local node
    std::vector<std::uint32_t> node;          ///< patch × local node: internal number
    std::vector<std::uint32_t> pressure;      ///< patch × local node: pressure node; empty for T4
    std::vector<std::uint32_t> place_begin;   ///< patch × local node, and the end
    std::vector<std::uint16_t> record_place;  ///< of forces, see place_of_record
    std::vector<std::uint16_t> scalar_place;  ///< of volumes; empty for T4
};

template <class T>
struct ElementBatches {
    PatchNodes nodes;
    std::vector<FanGroup> groups;
    std::vector<FanPatch> patches;
    std::size_t most_nodes = 0, most_places = 0;  ///< of a patch
    std::vector<std::int32_t> node;               ///< batch × 4 corners × width: 4·node
    AlignedVector<T> gradient;                    ///< batch × 9 × width, 1/mm
    AlignedVector<T> volume;                      ///< batch × width, mm³
    AlignedVector<T> volumetric_modulus;          ///< batch × width, kPa: what the element itself evaluates
    AlignedVector<T> fibre;                       ///< batch × 3 × width; empty where no material has fibres
    [[nodiscard]] std::size_t count() const { return volume.size() / batch_width; }
};

/// Where the record of a lane stands among the batch_width of its place: float32 records leave the registers as a
/// transposed 4 × 4 of them, which saves half of the shuffles.
template <class T>
constexpr std::size_t place_of_record(std::size_t lane) {
    return sizeof(T) == 4 ? lane % 4 * 4 + lane / 4 : lane;
}

/// What a thread works with, once for each.
template <class T>
struct PatchScratch {
    AlignedVector<T> local;  ///< a record for each local node: displacement and, for averaged pressure, M_a U'(J_a)
    AlignedVector<T> left;   ///< a record for each place
};

/// det F − 1 of each element of batches [begin, end) at displacement `u` (records).
template <class T>
void volume_changes(const ElementBatches<T>& elements, std::size_t begin, std::size_t end, const T* u,
                    T* jacobian_minus_1);
/// A material as the kernels take it: `law` indexes the alternatives of Material, the parameters are those of
/// tled/material/kernel_parameters.hpp.
template <class T>
struct KernelMaterial {
    std::size_t law = 0;
    std::array<T, 8> parameter{};
};

/// Sums over a patch's tetrahedra of the forces on its nodes at displacement `u` (records by internal number): to
/// `force` by internal number for own nodes, to `shared` by patch × local node for the others. `pressure` holds
/// M_a U'(J_a) per pressure node and is not read for T4.
template <class T>
void patch_forces(const KernelMaterial<T>& material, Kinematics kinematics, const ElementBatches<T>& elements,
                  const FanPatch& patch, const T* u, const T* pressure, PatchScratch<T>& scratch, T* force, T* shared);

/// Σ V (J − 1) of the tetrahedra at each of a patch's nodes, by patch × local node.
template <class T>
void patch_volume_changes(const ElementBatches<T>& elements, const FanPatch& patch, const T* u,
                          PatchScratch<T>& scratch, T* change);

/// v ← ρ v + c m⁻¹ (load − force) where `free` is not zero, else 0, and u ← u + v, for the records of `count` nodes.
template <class T>
void advance_nodes(T momentum, T gain, const T* inverse_mass, const T* load, const T* force, const T* free, T* v, T* u,
                   std::size_t count);

/// Of viscous stresses in a pass of the elements: taken as they rest; moved on, q⁺ = a S_shear + b q; or looked at as
/// they would be after that.
enum class Stresses { Rest, Move, Look };

/// The viscous stresses of a material's batches.
template <class T>
struct ViscousBatches {
    std::vector<std::array<T, 2>> coefficient;  ///< (a, b) of each term
    AlignedVector<T> stress;                    ///< batch × terms × 6 × width; V q, kPa mm³, 11 22 33 12 23 31
    std::size_t first_batch = 0;                ///< the batch that `stress` begins with
};

/// As patch_forces, with the viscous stresses taken off.
template <class T>
void viscous_patch_forces(const KernelMaterial<T>& material, ViscousBatches<T>& viscous, Stresses stresses,
                          Kinematics kinematics, const ElementBatches<T>& elements, const FanPatch& patch, const T* u,
                          const T* pressure, PatchScratch<T>& scratch, T* force, T* shared);

/// M U'(J) for J = 1 + `change`, per pressure node of one law.
template <class T>
void nodal_pressures(std::size_t law, const T* modulus, const T* change, T* pressure, std::size_t count);

/// The instruction set in use, for reports.
const char* instruction_set();

}  // namespace tissuewarp::tled::detail
