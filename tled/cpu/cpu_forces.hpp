#pragma once
/// Internal forces of all elements on the CPU: patches of tetrahedra over the nodes that they own, averaged
/// pressure and viscous stresses. All sums run in a fixed order.

#include "tled/cpu/cpu_batches.hpp"
#include "tled/cpu/cpu_kernels.hpp"
#include "tled/cpu/cpu_pressures.hpp"
#include "tled/cpu/fan_layout.hpp"
#include "tled/engine.hpp"
#include "tled/material/prony_coefficients.hpp"
#include "tled/parallel/parallel.hpp"

#include <tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

namespace tissuewarp::tled::detail {

template <class T>
StepBuffer step_buffer(const char* name, const std::vector<T>& values) {
    return {name, values.size() * sizeof(T)};
}

template <class T>
class CpuForces {
public:
    CpuForces(const RestState& rest, const FanLayout& fans)
        : layout_(fans.batches),
          elements_(element_batches<T>(rest, fans)),
          materials_(kernel_materials<T>(rest)),
          kinematics_(rest.pressure.count() > 0 ? Kinematics::AveragedPressure : Kinematics::T4),
          node_count_(static_cast<std::size_t>(rest.node_count)),
          tet_(rest.tet),
          own_nodes_(fans.own_nodes),
          sources_(force_sources(fans)),
          contribution_(elements_.nodes.node.size() * record, T(0)),
          pressures_(rest.pressure, fans) {
        for (const Material& material : rest.materials) law_of_.push_back(law_name(material));
        prepare_viscosity(rest);
    }

    /// Internal forces at displacement `u` to `force`; after(begin, end) as soon as those of nodes [begin, end) are
    /// there. It may move these nodes: no element that is still to come has one of them. Records of four per internal
    /// node.
    template <class After>
    void sum(T* u, Stresses stresses, std::vector<T>& force, const After& after) {
        if (kinematics_ == Kinematics::AveragedPressure) {
            for_patches([&](const FanPatch& patch, PatchScratch<T>& scratch) {
                patch_volume_changes(elements_, patch, u, scratch, pressures_.patch_changes());
            });
            pressures_.average(materials_);
        }
        for_patches([&](const FanPatch& patch, PatchScratch<T>& scratch) {
            tetrahedra(patch, u, stresses, scratch, force.data());
            after(patch.first_own, patch.first_own + patch.own_count);
        });
        parallel_ranges(own_nodes_, node_count_, 512, [&](std::size_t begin, std::size_t end) {
            for (std::size_t node = begin; node != end; ++node) sum_contributions(node, &force[node * record]);
            after(begin, end);
        });
    }

    /// s, by which viscous stresses move on where they do.
    void set_stress_interval(double interval) {
        for (std::size_t m = 0; m < viscous_.size(); ++m) {
            viscous_[m].coefficient.clear();
            for (const auto& [a, b] : prony_coefficients(viscosity_[m], interval))
                viscous_[m].coefficient.push_back({T(a), T(b)});
        }
    }
    void forget_stresses() {
        for (ViscousBatches<T>& viscous : viscous_) std::fill(viscous.stress.begin(), viscous.stress.end(), T(0));
    }
    [[nodiscard]] const std::vector<ViscousBatches<T>>& stresses() const { return viscous_; }
    void return_to(const std::vector<ViscousBatches<T>>& stresses) { viscous_ = stresses; }

    [[nodiscard]] SmallestJacobian smallest_jacobian(const T* u) {
        change_.resize(elements_.count() * batch_width);
        parallel_ranges(0, elements_.count(), 32, [&](std::size_t begin, std::size_t end) {
            volume_changes(elements_, begin, end, u, change_.data());
        });
        SmallestJacobian smallest{std::numeric_limits<double>::infinity()};
        for (std::size_t e = 0; e < layout_.slot.size(); ++e) {
            const double jacobian = 1 + double(change_[layout_.slot[e]]);
            if (std::isnan(jacobian)) return {-std::numeric_limits<double>::infinity(), tet_[e]};
            if (jacobian < smallest.value) smallest = {jacobian, tet_[e]};
        }
        return smallest;
    }

    /// The pass that averages volumes, if there is one.
    void add_volume_pass(const StepBuffer& u, std::vector<StepPass>& passes) const {
        if (kinematics_ == Kinematics::AveragedPressure)
            passes.push_back({"patch_volume_changes", {}, {u}, elements_.count() * batch_width});
    }
    void add_force_passes(const StepBuffer& u, std::vector<StepPass>& passes) const {
        for (const BatchBlock& block : layout_.blocks) passes.push_back(force_pass(block, u));
    }

private:
    BatchLayout layout_;
    ElementBatches<T> elements_;
    std::vector<KernelMaterial<T>> materials_;
    std::vector<std::string> law_of_;  // each of them
    Kinematics kinematics_;
    std::size_t node_count_;
    std::vector<int> tet_;
    std::size_t own_nodes_;        // internal numbers below belong to one patch
    SourceLists sources_;          // of the other nodes: of `contribution_`
    std::vector<T> contribution_;  // records by patch × local node
    tbb::enumerable_thread_specific<PatchScratch<T>> patch_scratch_;
    CpuPressures<T> pressures_;

    // by material; empty where none is viscous
    std::vector<PronySeries> viscosity_;
    std::vector<ViscousBatches<T>> viscous_;

    std::vector<T> change_;  // J − 1 of elements in batches

    void prepare_viscosity(const RestState& rest) {
        viscosity_ = rest.viscosity;
        viscous_.resize(viscosity_.size());
        if (!viscosity_.empty())
            for (const BatchBlock& block : layout_.blocks) {
                const auto m = static_cast<std::size_t>(block.material);
                viscous_[m].first_batch = block.begin;
                viscous_[m].stress.assign((block.end - block.begin) * viscosity_[m].terms.size() * 6 * batch_width,
                                          T(0));
            }
        set_stress_interval(0);
    }

    /// body(patch, scratch) for all patches.
    template <class Body>
    void for_patches(const Body& body) {
        parallel_ranges(0, elements_.patches.size(), 1, [&](std::size_t begin, std::size_t end) {
            PatchScratch<T>& scratch = patch_scratch_.local();
            for (std::size_t p = begin; p != end; ++p) body(elements_.patches[p], scratch);
        });
    }

    void tetrahedra(const FanPatch& patch, const T* u, Stresses stresses, PatchScratch<T>& scratch, T* force) {
        const std::size_t m = patch.material;
        if (viscous_.empty() || viscous_[m].coefficient.empty())
            patch_forces(materials_[m], kinematics_, elements_, patch, u, pressures_.pressure(), scratch, force,
                         contribution_.data());
        else
            viscous_patch_forces(materials_[m], viscous_[m], stresses, kinematics_, elements_, patch, u,
                                 pressures_.pressure(), scratch, force, contribution_.data());
    }

    void sum_contributions(std::size_t node, T* force) {
        std::array<T, record> sum{};
        const std::size_t list = node - own_nodes_;
        for (std::uint32_t k = sources_.offset[list]; k < sources_.offset[list + 1]; ++k) {
            const T* f = &contribution_[std::size_t{sources_.entry[k]} * record];
            for (std::size_t c = 0; c < record; ++c) sum[c] += f[c];
        }
        std::copy(sum.begin(), sum.end(), force);
    }

    [[nodiscard]] StepPass force_pass(const BatchBlock& block, const StepBuffer& u) const {
        const auto m = static_cast<std::size_t>(block.material);
        StepPass pass{"patch_forces", {law_of_[m]}, {u}, (block.end - block.begin) * batch_width};
        if (kinematics_ == Kinematics::AveragedPressure) pass.parts.push_back("averaged pressure");
        pass.buffers.push_back(step_buffer("forces of shared nodes", contribution_));
        if (!viscosity_.empty() && !viscosity_[m].terms.empty()) {
            pass.parts.push_back("viscosity");
            pass.buffers.push_back({"viscous stresses", viscous_[m].stress.size() * sizeof(T)});
        }
        return pass;
    }
};

}  // namespace tissuewarp::tled::detail
