#include "tled/gpu/patch_tissue.hpp"

#include "tled/material/prony_coefficients.hpp"

namespace tissuewarp::tled::detail {
namespace {

/// (x, y) of the fibre, or of its opposite, on the half z ≥ 0 of the octahedron |x| + |y| + z = 1.
Float2 folded(const Eigen::Vector3d& fibre) {
    const double scale = (fibre.z() < 0 ? -1 : 1) / fibre.lpNorm<1>();
    return {static_cast<float>(scale * fibre.x()), static_cast<float>(scale * fibre.y())};
}

}  // namespace

shaders::Law law_of(const RestState& rest) {
    return static_cast<shaders::Law>(rest.materials[static_cast<std::size_t>(rest.blocks.front().material)].index());
}

TissueOfPatches::TissueOfPatches(const shaders::Device& device, const RestState& rest, const PatchLayout& layout,
                                 BlockBuffers& blocks)
    : kind_{law_of(rest), static_cast<int>(most_terms(rest.viscosity))},
      series_(rest.viscosity),
      element_count_(static_cast<std::size_t>(rest.element_count())),
      places_(layout.element_of_place.size()) {
    if (planes() == 0) return;
    tissue_.emplace(device, first_coefficient() + series_.size() * most_terms(series_), "tissue of patches");
    blocks.set("PatchTissue", *tissue_);
    const shaders::CurrentContext current = device.make_current();
    if (shaders::has_fibres(kind_.law)) {
        std::vector<Float2> fibres(places_, Float2{0.0F, 0.0F});
        for (std::size_t place = 0; place < places_; ++place)
            if (const std::uint32_t e = layout.element_of_place[place]; e != no_slot)
                fibres[place] = folded(rest.fibre.col(static_cast<Eigen::Index>(e)));
        tissue_->upload(fibres);
    }
    if (!viscous()) return;
    element_of_place_.emplace(device, layout.element_of_place, "elements of patches");
    blocks.set("PatchElement", *element_of_place_);
    upload_coefficients();
}

std::size_t TissueOfPatches::planes() const {
    return (shaders::has_fibres(kind_.law) ? 1U : 0U) + 3 * static_cast<std::size_t>(kind_.prony_terms);
}

/// As shaders/chunks/patch.tissue.glsl has it; without viscosity the end.
std::size_t TissueOfPatches::first_coefficient() const {
    return planes() * places_ + (viscous() ? places_ + (places_ + 1) / 2 : 0);
}

std::size_t TissueOfPatches::stress_bytes(std::size_t places) const {
    return 3 * static_cast<std::size_t>(kind_.prony_terms) * sizeof(Float2) * places;
}

void TissueOfPatches::set_places(const shaders::Program& program) const {
    if (planes() > 0) program.set(13, static_cast<std::uint32_t>(places_));
}

void TissueOfPatches::set_stress_interval(double interval) {
    if (!viscous() || interval == interval_) return;
    interval_ = interval;
    upload_coefficients();
}

void TissueOfPatches::upload_coefficients() {
    tissue_->upload(prony_table(series_, interval_), first_coefficient());
}

void TissueOfPatches::load_stresses(shaders::ProgramCache& programs, const BlockBuffers& blocks) const {
    run_over_places(shaders::PatchStresses::Load, programs, blocks);
}

void TissueOfPatches::store_stresses(shaders::ProgramCache& programs, const BlockBuffers& blocks) const {
    run_over_places(shaders::PatchStresses::Store, programs, blocks);
}

void TissueOfPatches::sum_stresses(shaders::ProgramCache& programs, const BlockBuffers& blocks) const {
    run_over_places(shaders::PatchStresses::Sum, programs, blocks);
}

void TissueOfPatches::run_over_places(shaders::PatchStresses what, shaders::ProgramCache& programs,
                                      const BlockBuffers& blocks) const {
    if (!viscous()) return;
    const shaders::Program& program = programs.get(shaders::patch_stress_program(kind_, what));
    program.set(0, static_cast<std::uint32_t>(element_count_));
    blocks.bind(program);
    program.dispatch(places_);
    shaders::storage_barrier();
}

}  // namespace tissuewarp::tled::detail
