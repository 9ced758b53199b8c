// The element pass of total Lagrangian dynamics for patches of linear tetrahedra in fans: a fan loads each of its nodes
// once from the patch's copy and leaves one force for it, which the patch's nodes then sum in a fixed order.
// Included once for each instruction set (Highway's convention for -inl files).

// clang-format off
#if defined(TISSUEWARP_CPU_FANS_INL) == defined(HWY_TARGET_TOGGLE)
#ifdef TISSUEWARP_CPU_FANS_INL
#undef TISSUEWARP_CPU_FANS_INL
#else
#define TISSUEWARP_CPU_FANS_INL
#endif
// clang-format on

#include <hwy/highway.h>

#include "tled/cpu/cpu_elements-inl.hpp"
#include "tled/cpu/cpu_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace tissuewarp::tled::detail {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// float32 moves whole records between memory and vectors of four lanes and more.
template <class D>
constexpr bool moves_records = sizeof(Scalar<D>) == 4 && hn::MaxLanes(D()) >= record;

#if HWY_TARGET != HWY_SCALAR  // which has no blocks
/// Block b of the vector is the record of local node lane_node[4 b].
template <class D>
HWY_INLINE Vec<D> load_blocks(D d, const float* local, const std::uint16_t* lane_node) {
    if constexpr (hn::MaxLanes(D()) == record) {
        return hn::LoadU(d, local + std::size_t{lane_node[0]} * record);
    } else {
        const hn::Half<D> half;
        return hn::Combine(d, load_blocks(half, local, lane_node + hn::MaxLanes(half)),
                           load_blocks(half, local, lane_node));
    }
}

/// Transposes the 4 × 4 matrices that the blocks of four vectors form; its own inverse.
template <class D>
HWY_INLINE void transpose_blocks(D d, Vec<D> (&v)[4]) {
    const auto low_02 = hn::InterleaveLower(d, v[0], v[2]), low_13 = hn::InterleaveLower(d, v[1], v[3]);
    const auto high_02 = hn::InterleaveUpper(d, v[0], v[2]), high_13 = hn::InterleaveUpper(d, v[1], v[3]);
    v[0] = hn::InterleaveLower(d, low_02, low_13);
    v[1] = hn::InterleaveUpper(d, low_02, low_13);
    v[2] = hn::InterleaveLower(d, high_02, high_13);
    v[3] = hn::InterleaveUpper(d, high_02, high_13);
}
#endif

/// The four components of the records of local nodes lane_node[0 … lanes − 1].
template <class D, class T>
HWY_INLINE void load_records(D d, const T* local, const std::uint16_t* lane_node, Vec<D> (&v)[4]) {
#if HWY_TARGET != HWY_SCALAR
    if constexpr (moves_records<D>) {
        for (std::size_t i = 0; i < 4; ++i) v[i] = load_blocks(d, local, lane_node + i);
        transpose_blocks(d, v);
        return;
    }
#endif
    std::int32_t offset[hn::MaxLanes(D())];
    for (std::size_t i = 0; i < hn::MaxLanes(D()); ++i) offset[i] = record * lane_node[i];
    for (std::size_t c = 0; c < 4; ++c) v[c] = gather(d, local + c, offset);
}

/// The records of lanes lane … lane + lanes − 1 to where place_of_record says.
template <class D, class T>
HWY_INLINE void store_records(D d, const Vec<D> (&f)[3], int lane, T* left) {
#if HWY_TARGET != HWY_SCALAR
    if constexpr (moves_records<D>) {
        Vec<D> v[4] = {f[0], f[1], f[2], hn::Zero(d)};
        transpose_blocks(d, v);
        for (int i = 0; i < 4; ++i) hn::Store(v[i], d, left + i * batch_width + lane);
        return;
    }
#endif
    hn::StoreInterleaved4(f[0], f[1], f[2], hn::Zero(d), d,
                          left + place_of_record<T>(static_cast<std::size_t>(lane)) * record);
}

template <class D, class T>
HWY_INLINE void copy_local_nodes(D d, const PatchNodes& nodes, const FanPatch& patch, const T* u, T* local) {
    const std::uint32_t* node = &nodes.node[patch.first_node];
    for (std::size_t i = 0; i < patch.node_count; ++i)
        for (std::size_t c = 0; c < record; c += hn::Lanes(d))
            hn::Store(hn::LoadU(d, u + std::size_t{node[i]} * record + c), d, local + i * record + c);
}

/// The nodes of a fan as it goes around its edge a b: b and two neighbours of the ring, relative to a.
template <class D>
struct FanNodes {
    Vec<D> a[4], b[4], from[4], to[4];
};

/// Displacements of ring node `k` relative to a; the fourth component is left as it is.
template <class D, class T>
HWY_INLINE void load_relative(D d, const T* local, const std::uint16_t* node, const Vec<D> (&a)[4], Vec<D> (&v)[4]) {
    load_records(d, local, node, v);
    for (int c = 0; c < 3; ++c) v[c] = v[c] - a[c];
}

template <class D, class T>
HWY_INLINE Strain<D> strain_of(D d, const FanNodes<D>& fan, const T* gradient) {
    Strain<D> strain;
    for (int j = 0; j < 3; ++j) {
        const auto b0 = hn::Load(d, gradient + j * batch_width);
        const auto b1 = hn::Load(d, gradient + (3 + j) * batch_width);
        const auto b2 = hn::Load(d, gradient + (6 + j) * batch_width);
        for (int i = 0; i < 3; ++i)
            strain.H[i][j] = hn::MulAdd(fan.b[i], b0, hn::MulAdd(fan.from[i], b1, fan.to[i] * b2));
    }
    finish_strain(d, strain);
    return strain;
}

/// f += P ∂N/∂X.
template <class D, class T>
HWY_INLINE void add_force(D d, const Vec<D> (&P)[3][3], const T* gradient, Vec<D> (&f)[3]) {
    for (int j = 0; j < 3; ++j) {
        const auto b = hn::Load(d, gradient + j * batch_width);
        for (int i = 0; i < 3; ++i) f[i] = hn::MulAdd(P[i][j], b, f[i]);
    }
}

/// V p, kPa mm³: of the mean of the nodal pressures, or of the element.
template <class Law, Kinematics kinematics, class D, class T>
HWY_INLINE Vec<D> scaled_pressure(D d, const ElementBatches<T>& elements, std::size_t at, const FanNodes<D>& fan,
                                  Vec<D> volume, Vec<D> change) {
    if constexpr (kinematics == Kinematics::AveragedPressure)
        return volume * ((fan.a[3] + fan.b[3] + fan.from[3] + fan.to[3]) * hn::Set(d, T(0.25)));
    else
        return volume * (hn::Load(d, &elements.volumetric_modulus[at]) * Response<Law>::pressure_factor(d, change));
}

/// Forces f_I = V P ∂N_I/∂X of a group's fans on their nodes; those of a tetrahedron sum to zero.
template <class Law, Kinematics kinematics, class D, class T, class AfterShear>
void fan_forces(D d, const T* parameter, const ElementBatches<T>& elements, const FanGroup& group,
                const std::uint16_t* node, int lane, const T* local, T* left, const AfterShear& after_shear) {
    const auto place = [&](int k) { return left + k * batch_width * record; };
    const auto zero = hn::Zero(d);
    node += lane;
    FanNodes<D> fan;
    load_records(d, local, node, fan.a);
    load_relative(d, local, node + batch_width, fan.a, fan.b);
    load_relative(d, local, node + 2 * batch_width, fan.a, fan.from);
    Vec<D> f_b[3] = {zero, zero, zero}, f_from[3] = {zero, zero, zero}, ring[3] = {zero, zero, zero};
    for (int k = 0; k < group.length; ++k) {
        load_relative(d, local, node + (3 + k) * batch_width, fan.a, fan.to);
        const std::size_t batch = group.first_batch + static_cast<std::size_t>(k);
        const std::size_t at = batch * batch_width + static_cast<std::size_t>(lane);
        const T* gradient = &elements.gradient[batch * 9 * batch_width + static_cast<std::size_t>(lane)];
        auto strain = strain_of(d, fan, gradient);
        strain.change = admissible<Law>(d, strain.change);
        const auto volume = hn::Load(d, &elements.volume[at]);
        const auto pressure = scaled_pressure<Law, kinematics>(d, elements, at, fan, volume, strain.change);
        Vec<D> P[3][3];
        stress<Law>(d, batch, lane, strain, tissue_of<Law, D>(d, parameter, elements, batch, lane), volume, pressure,
                    after_shear, P);
        Vec<D> f_to[3] = {zero, zero, zero};
        add_force(d, P, gradient, f_b);
        add_force(d, P, gradient + 3 * batch_width, f_from);
        add_force(d, P, gradient + 6 * batch_width, f_to);
        store_records(d, f_from, lane, place(2 + k));
        for (int c = 0; c < 3; ++c) {
            ring[c] = ring[c] + f_from[c];
            f_from[c] = f_to[c];
        }
        for (int c = 0; c < 4; ++c) fan.from[c] = fan.to[c];
    }
    store_records(d, f_from, lane, place(2 + group.length));
    store_records(d, f_b, lane, place(1));
    Vec<D> f_a[3];
    for (int c = 0; c < 3; ++c) f_a[c] = hn::Neg(f_b[c] + (ring[c] + f_from[c]));
    store_records(d, f_a, lane, place(0));
}

/// Sums of the records at the places of local nodes begin … end − 1, to `force` one after another.
template <class D, class T>
HWY_INLINE void sum_places(D d, const PatchNodes& nodes, std::size_t begin, std::size_t end, const T* left, T* force) {
    for (std::size_t i = begin; i < end; ++i, force += record) {
        const std::uint16_t *place = &nodes.record_place[nodes.place_begin[i]],
                            *last = nodes.record_place.data() + nodes.place_begin[i + 1];
        for (std::size_t c = 0; c < record; c += hn::Lanes(d)) {
            auto sum = hn::Zero(d);
            for (const std::uint16_t* k = place; k != last; ++k)
                sum = sum + hn::Load(d, left + std::size_t{*k} * record + c);
            hn::StoreU(sum, d, force + c);
        }
    }
}

template <class Law, Kinematics kinematics, class T, class AfterShear = Elastic>
void patch_forces_of(const T* parameter, const ElementBatches<T>& elements, const FanPatch& patch, const T* u,
                     const T* pressure, PatchScratch<T>& scratch, T* force, T* shared,
                     const AfterShear& after_shear = {}) {
    const hn::CappedTag<T, batch_width> d;
    const hn::CappedTag<T, record> one_record;
    const PatchNodes& nodes = elements.nodes;
    scratch.local.resize(elements.most_nodes * record);
    scratch.left.resize(elements.most_places * record);
    T *local = scratch.local.data(), *left = scratch.left.data();
    copy_local_nodes(one_record, nodes, patch, u, local);
    if constexpr (kinematics == Kinematics::AveragedPressure)
        for (std::size_t i = 0; i < patch.node_count; ++i)
            local[i * record + 3] = pressure[nodes.pressure[patch.first_node + i]];
    for (std::size_t g = patch.first_group; g < patch.end_group; ++g) {
        const FanGroup& group = elements.groups[g];
        const std::uint16_t* node = &nodes.fan_node[patch.first_fan_node + group.first_place];
        for (int lane = 0; lane < batch_width; lane += static_cast<int>(hn::Lanes(d)))
            fan_forces<Law, kinematics>(d, parameter, elements, group, node, lane, local,
                                        left + group.first_place * record, after_shear);
    }
    const std::size_t first_shared = patch.first_node + patch.own_count;
    sum_places(one_record, nodes, patch.first_node, first_shared, left, force + patch.first_own * record);
    sum_places(one_record, nodes, first_shared, patch.first_node + patch.node_count, left,
               shared + first_shared * record);
}

/// V (J − 1) of a group's fans, summed at each of their nodes.
template <class D, class T>
void fan_volume_changes(D d, const ElementBatches<T>& elements, const FanGroup& group, const std::uint16_t* node,
                        int lane, const T* local, T* left) {
    const auto store = [&](int k, Vec<D> change) { hn::Store(change, d, left + k * batch_width + lane); };
    node += lane;
    FanNodes<D> fan;
    load_records(d, local, node, fan.a);
    load_relative(d, local, node + batch_width, fan.a, fan.b);
    load_relative(d, local, node + 2 * batch_width, fan.a, fan.from);
    auto sum = hn::Zero(d), before = sum;
    for (int k = 0; k < group.length; ++k) {
        load_relative(d, local, node + (3 + k) * batch_width, fan.a, fan.to);
        const std::size_t batch = group.first_batch + static_cast<std::size_t>(k);
        const std::size_t at = batch * batch_width + static_cast<std::size_t>(lane);
        const T* gradient = &elements.gradient[batch * 9 * batch_width + static_cast<std::size_t>(lane)];
        const auto change = hn::Load(d, &elements.volume[at]) * strain_of(d, fan, gradient).change;
        store(2 + k, before + change);
        sum = sum + change;
        before = change;
        for (int c = 0; c < 3; ++c) fan.from[c] = fan.to[c];
    }
    store(2 + group.length, before);
    store(0, sum);
    store(1, sum);
}

template <class T>
void patch_volume_changes_of(const ElementBatches<T>& elements, const FanPatch& patch, const T* u,
                             PatchScratch<T>& scratch, T* change) {
    const hn::CappedTag<T, batch_width> d;
    const PatchNodes& nodes = elements.nodes;
    scratch.local.resize(elements.most_nodes * record);
    scratch.left.resize(elements.most_places * record);
    T *local = scratch.local.data(), *left = scratch.left.data();
    copy_local_nodes(hn::CappedTag<T, record>(), nodes, patch, u, local);
    for (std::size_t g = patch.first_group; g < patch.end_group; ++g) {
        const FanGroup& group = elements.groups[g];
        const std::uint16_t* node = &nodes.fan_node[patch.first_fan_node + group.first_place];
        for (int lane = 0; lane < batch_width; lane += static_cast<int>(hn::Lanes(d)))
            fan_volume_changes(d, elements, group, node, lane, local, left + group.first_place);
    }
    for (std::size_t i = patch.first_node; i < patch.first_node + patch.node_count; ++i) {
        T sum = 0;
        for (std::uint32_t k = nodes.place_begin[i]; k < nodes.place_begin[i + 1]; ++k)
            sum += left[nodes.scalar_place[k]];
        change[i] = sum;
    }
}

/// Constrained components are selected, not multiplied by zero: a blown-up state would leave NaN on them for good.
template <class T>
void advance_nodes_of(T momentum, T gain, const T* inverse_mass, const T* load, const T* force, const T* free, T* v,
                      T* u, std::size_t count) {
    const auto advance = [&](auto d, std::size_t i) {
        const auto residual = hn::LoadU(d, load + i) - hn::LoadU(d, force + i);
        const auto pushed = hn::MulAdd(hn::Set(d, momentum), hn::LoadU(d, v + i),
                                       hn::Set(d, gain) * hn::LoadU(d, inverse_mass + i) * residual);
        const auto increment = hn::IfThenElseZero(hn::LoadU(d, free + i) != hn::Zero(d), pushed);
        hn::StoreU(increment, d, v + i);
        hn::StoreU(hn::LoadU(d, u + i) + increment, d, u + i);
    };
    const hn::CappedTag<T, batch_width> d;
    const std::size_t lanes = hn::Lanes(d), numbers = count * record;
    std::size_t i = 0;
    for (; i + lanes <= numbers; i += lanes) advance(d, i);
    const hn::CappedTag<T, record> rest;
    for (; i < numbers; i += hn::Lanes(rest)) advance(rest, i);
}

}  // namespace HWY_NAMESPACE
}  // namespace tissuewarp::tled::detail
HWY_AFTER_NAMESPACE();

#endif  // TISSUEWARP_CPU_FANS_INL
