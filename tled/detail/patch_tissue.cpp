#include "tled/detail/patch_tissue.hpp"

#include "tled/detail/folded_fibre.hpp"
#include "tled/detail/prony_coefficients.hpp"

#include <bit>

namespace tissuewarp::tled::detail {
namespace {

constexpr std::uint32_t none = 0xffffffffU;

/// Of every place; 0 where a fan has none.
std::vector<std::uint32_t> folded_fibres(const RestState& rest, const PatchLayout& layout) {
    std::vector<std::uint32_t> fibres(layout.element_of_place.size());
    for (std::size_t place = 0; place < fibres.size(); ++place)
        if (const std::uint32_t e = layout.element_of_place[place]; e != none)
            fibres[place] = folded_fibre(rest.fibre.col(static_cast<Eigen::Index>(e)));
    return fibres;
}

/// Four words of a place of which the fibre is the last: no stress yet.
std::vector<std::uint32_t> with_resting_stresses(const std::vector<std::uint32_t>& fibres) {
    std::vector<std::uint32_t> words(4 * fibres.size());
    for (std::size_t place = 0; place < fibres.size(); ++place) words[4 * place + 3] = fibres[place];
    return words;
}

std::vector<std::uint32_t> words_of(const std::vector<Float2>& numbers) {
    std::vector<std::uint32_t> words;
    for (const auto& [x, y] : numbers) {
        words.push_back(std::bit_cast<std::uint32_t>(x));
        words.push_back(std::bit_cast<std::uint32_t>(y));
    }
    return words;
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
    const bool fibres = shaders::has_fibres(kind_.law);
    if (!fibres && !viscous()) return;
    tissue_.emplace(device, viscous() ? first_coefficient() + 2 * series_.size() * most_terms(series_) : places_,
                    "tissue of patches");
    blocks.set("PatchTissue", *tissue_);
    const shaders::CurrentContext current = device.make_current();
    if (fibres) {
        const std::vector<std::uint32_t> words = folded_fibres(rest, layout);
        tissue_->upload(viscous() ? with_resting_stresses(words) : words);
    }
    if (!viscous()) return;
    element_of_place_.emplace(device, layout.element_of_place, "elements of patches");
    blocks.set("PatchElement", *element_of_place_);
    upload_coefficients();
}

std::size_t TissueOfPatches::first_coefficient() const {
    return (4 + 6 * static_cast<std::size_t>(kind_.prony_terms)) * places_;
}

void TissueOfPatches::set_places(const shaders::Program& program) const {
    if (tissue_) program.set(13, static_cast<std::uint32_t>(places_));
}

void TissueOfPatches::set_stress_interval(double interval) {
    if (!viscous() || interval == interval_) return;
    interval_ = interval;
    upload_coefficients();
}

void TissueOfPatches::upload_coefficients() {
    tissue_->upload(words_of(prony_table(series_, interval_)), first_coefficient());
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
    const shaders::Program& program = programs.get(shaders::patch_stress_program(kind_.prony_terms, what));
    program.set(0, static_cast<std::uint32_t>(element_count_));
    blocks.bind(program);
    program.dispatch(places_);
    shaders::storage_barrier();
}

}  // namespace tissuewarp::tled::detail
