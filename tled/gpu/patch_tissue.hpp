#pragma once
/// What the tetrahedra of patches have for themselves on the device: fibres and viscous stresses, in the layout of
/// shaders/chunks/patch.tissue.glsl. Empty where the scene has neither. Needs the device's context current, except
/// construction.

#include "tled/gpu/gpu_force.hpp"
#include "tled/gpu/patch_layout.hpp"

#include <optional>

namespace tissuewarp::tled::detail {

/// That of the first tetrahedra; patches know scenes of one law.
shaders::Law law_of(const RestState& rest);

class TissueOfPatches {
public:
    TissueOfPatches(const shaders::Device& device, const RestState& rest, const PatchLayout& layout,
                    BlockBuffers& blocks);

    /// The law, and the most terms of viscosity.
    [[nodiscard]] const shaders::PatchTissue& kind() const { return kind_; }
    /// Neither fibres nor viscosity.
    [[nodiscard]] bool empty() const { return !tissue_; }
    [[nodiscard]] bool viscous() const { return kind_.prony_terms > 0; }
    /// Bytes of shared memory of `places` tetrahedra's viscous stresses.
    [[nodiscard]] std::size_t stress_bytes(std::size_t places) const;
    /// The uniform of shaders/chunks/patch.tissue.glsl, where the program has it.
    void set_places(const shaders::Program& program) const;
    /// By which viscous stresses move on, s.
    void set_stress_interval(double interval);
    /// Viscous stresses from those of elements (ViscousStress of the blocks), and back to them.
    void load_stresses(shaders::ProgramCache& programs, const BlockBuffers& blocks) const;
    void store_stresses(shaders::ProgramCache& programs, const BlockBuffers& blocks) const;
    /// What steps in which stresses rest read: the sum of the terms, in half precision.
    void sum_stresses(shaders::ProgramCache& programs, const BlockBuffers& blocks) const;

private:
    void run_over_places(shaders::PatchStresses what, shaders::ProgramCache& programs,
                         const BlockBuffers& blocks) const;
    [[nodiscard]] std::size_t planes() const;
    [[nodiscard]] std::size_t first_coefficient() const;
    void upload_coefficients();

    shaders::PatchTissue kind_;
    std::vector<PronySeries> series_;
    double interval_ = 0;
    std::size_t element_count_, places_;
    std::optional<shaders::Buffer<Float2>> tissue_;
    std::optional<shaders::Buffer<std::uint32_t>> element_of_place_;
};

}  // namespace tissuewarp::tled::detail
