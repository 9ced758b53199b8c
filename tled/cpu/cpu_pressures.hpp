#pragma once
/// Averaged nodal pressures of the CPU engine (Bonet and Burton 1998): what its patches leave, summed by node.

#include "tled/cpu/cpu_batches.hpp"
#include "tled/cpu/fan_layout.hpp"
#include "tled/parallel/parallel.hpp"

#include <vector>

namespace tissuewarp::tled::detail {

/// Empty for models without averaged pressure.
template <class T>
class CpuPressures {
public:
    CpuPressures(const PressureNodes& pressure, const FanLayout& fans) {
        const auto count = static_cast<std::size_t>(pressure.count());
        if (count == 0) return;
        sources_ = pressure_sources(pressure, fans);
        patch_change_.assign(fans.nodes.node.size(), T(0));
        inverse_volume_.resize(count);
        modulus_.resize(count);
        change_.assign(count, T(0));
        pressure_.assign(count, T(0));
        for (std::size_t a = 0; a < count; ++a) {
            inverse_volume_[a] = T(1 / pressure.volume[static_cast<Eigen::Index>(a)]);
            modulus_[a] = T(pressure.modulus[static_cast<Eigen::Index>(a)]);
            if (runs_.empty() || runs_.back().material != pressure.material[a])
                runs_.push_back({pressure.material[a], a, a});
            runs_.back().end = a + 1;
        }
    }

    /// Σ V (J − 1) by patch × local node, to be filled before `average`.
    [[nodiscard]] T* patch_changes() { return patch_change_.data(); }

    /// p_a = M_a U'(J_a) with J_a − 1 = Σ ¼ V_e (J_e − 1) / V_a.
    void average(const std::vector<KernelMaterial<T>>& materials) {
        for (const BatchBlock& run : runs_)
            parallel_ranges(run.begin, run.end, 1024, [&](std::size_t begin, std::size_t end) {
                for (std::size_t a = begin; a != end; ++a) {
                    T sum = 0;
                    for (std::uint32_t k = sources_.offset[a]; k < sources_.offset[a + 1]; ++k)
                        sum += patch_change_[sources_.entry[k]];
                    change_[a] = T(0.25) * sum * inverse_volume_[a];
                }
                nodal_pressures(materials[static_cast<std::size_t>(run.material)].law, &modulus_[begin],
                                &change_[begin], &pressure_[begin], end - begin);
            });
    }

    /// kPa, per pressure node.
    [[nodiscard]] const T* pressure() const { return pressure_.data(); }

private:
    SourceLists sources_;  // of `patch_change_`
    std::vector<T> patch_change_, inverse_volume_, modulus_, change_, pressure_;
    std::vector<BatchBlock> runs_;  // of pressure nodes that share a material
};

}  // namespace tissuewarp::tled::detail
