#pragma once
/// The inner loops of the CPU engine, compiled once per instruction set and chosen at run time (Highway). T is float or
/// double.

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace tissuewarp::tled::detail {

/// Elements are stored in batches of `batch_width`, structure of arrays within a batch; a material starts a new batch
/// and is padded with copies of its last element that have zero volume.
inline constexpr int batch_width = 16;

enum class Kinematics { T4, AveragedPressure };

/// Nodal vectors are records of four numbers (x, y, z, 0), so that a node is one load.
inline constexpr int record = 4;

template <class T>
struct ElementBatches {
    std::vector<std::int32_t> node;      ///< batch × 4 corners × width: 4·node
    std::vector<std::int32_t> pressure;  ///< batch × 4 corners × width: pressure node; empty for T4
    std::vector<T> gradient;             ///< batch × 9 × width, 1/mm
    std::vector<T> volume;               ///< batch × width, mm³
    std::vector<T> volumetric_modulus;   ///< batch × width, kPa: what the element itself evaluates
    std::vector<T> fibre;                ///< batch × 3 × width; empty where no material has fibres
    [[nodiscard]] std::size_t count() const { return volume.size() / batch_width; }
};

/// One-point hexahedra (tled/hex_state.hpp), in the same batches.
template <class T>
struct HexBatches {
    std::vector<std::int32_t> node;      ///< batch × 8 corners × width: 4·node
    std::vector<T> gradient;             ///< batch × 21 × width, 1/mm
    std::vector<T> volume;               ///< batch × width, mm³
    std::vector<T> volumetric_modulus;   ///< batch × width, kPa
    std::vector<T> rest_hourglass;       ///< batch × 12 × width, mm
    std::vector<T> hourglass_stiffness;  ///< batch × width, mN/mm
    std::vector<T> fibre;                ///< batch × 3 × width; empty where no material has fibres
    [[nodiscard]] std::size_t count() const { return volume.size() / batch_width; }
};

/// det F − 1 of each element of batches [begin, end) at displacement `u` (records).
template <class T>
void volume_changes(const ElementBatches<T>& elements, std::size_t begin, std::size_t end, const T* u,
                    T* jacobian_minus_1);
template <class T>
void hex_volume_changes(const HexBatches<T>& hexahedra, std::size_t begin, std::size_t end, const T* u,
                        T* jacobian_minus_1);

/// A material as the kernels take it: `law` indexes the alternatives of Material, the parameters are those of
/// detail/kernel_parameters.hpp.
template <class T>
struct KernelMaterial {
    std::size_t law = 0;
    std::array<T, 8> parameter{};
};

/// Nodal forces of each element's four corners, one record each at batch·4·width + corner·width + lane. `pressure`
/// holds M_a U'(J_a) per pressure node and is not read for T4.
template <class T>
void element_forces(const KernelMaterial<T>& material, Kinematics kinematics, const ElementBatches<T>& elements,
                    std::size_t begin, std::size_t end, const T* u, const T* pressure, T* force);

/// The same for the eight corners of hexahedra, records at batch·8·width + corner·width + lane.
template <class T>
void hex_forces(const KernelMaterial<T>& material, const HexBatches<T>& hexahedra, std::size_t begin, std::size_t end,
                const T* u, T* force);

enum class Advance { No, Yes };

/// The viscous stresses of a material's batches and their backward-Euler step q⁺ = a S_shear + b q.
template <class T>
struct ViscousBatches {
    std::vector<std::array<T, 2>> coefficient;  ///< (a, b) of each term
    std::vector<T> stress;                      ///< batch × terms × 6 × width; V q, kPa mm³, 11 22 33 12 23 13
    std::size_t first_batch = 0;                ///< the batch that `stress` begins with
};

/// As element_forces, with the viscous stresses at the end of the step taken off; they are kept where time advances.
template <class T>
void viscous_element_forces(const KernelMaterial<T>& material, ViscousBatches<T>& viscous, Advance advance,
                            Kinematics kinematics, const ElementBatches<T>& elements, std::size_t begin,
                            std::size_t end, const T* u, const T* pressure, T* force);

template <class T>
void viscous_hex_forces(const KernelMaterial<T>& material, ViscousBatches<T>& viscous, Advance advance,
                        const HexBatches<T>& hexahedra, std::size_t begin, std::size_t end, const T* u, T* force);

/// M U'(J) for J = 1 + `change`, per pressure node of one law.
template <class T>
void nodal_pressures(std::size_t law, const T* modulus, const T* change, T* pressure, std::size_t count);

/// The instruction set in use, for reports.
const char* instruction_set();

}  // namespace tissuewarp::tled::detail
