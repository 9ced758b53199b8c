#include "tled/gpu/step_shapes.hpp"

#include "tled/engine.hpp"

#include <algorithm>

namespace tissuewarp::tled {

GpuStepShape suggested_gpu_step_shape(int element_count, Element element, int multiprocessors) {
    // Patches in multiples of the multiprocessors, so that none of these idles; larger ones lose less at their surfaces
    // as long as their nodes fit into shared memory, of which a regular mesh has more than others; patches that do not
    // are made smaller. One workgroup of 640 always fits on a multiprocessor; two smaller ones may be faster, but
    // whether they fit depends on how many registers the compiler takes. From a few patches each on, memory is what
    // limits, and going round and round in one dispatch gains nothing: 2 were measured to be the faster, 4 and 6 the
    // slower. There averaged pressure takes patches that fit whole: of those that are split some workgroups get two.
    constexpr int largest_patch = detail::largest_patch_tets(Element::T4), few_each = 3;
    if (multiprocessors <= 0) multiprocessors = detail::default_multiprocessors;
    const int of_each = element_count / multiprocessors;
    const auto shared_out = [&](int patches) {
        return std::max(detail::least_patch_tets, (element_count + patches - 1) / patches);
    };
    const auto multiple = [&](int patches, int tets) { return patches * ((element_count - 1) / (patches * tets) + 1); };
    if (of_each < 150) return {shared_out(multiprocessors), 1, 128, 4 * multiprocessors};
    if (of_each < 900) return {shared_out(multiprocessors), 2, 512, multiprocessors};
    if (of_each < detail::largest_patch_tets(element)) return {shared_out(multiprocessors), 5, 640, multiprocessors};
    const int patches = multiple(multiprocessors, largest_patch);
    if (patches <= few_each * multiprocessors) return {shared_out(patches), 5, 640, multiprocessors};
    return {shared_out(multiple(multiprocessors, detail::largest_patch_tets(element))), 5, 768, 0};
}

std::string name_of(const GpuStepShape& shape) {
    if (shape.patch_tets == 0) return "two passes";
    std::string name = std::to_string(shape.patch_tets) + ':' + std::to_string(shape.longest_fan) + ':' +
                       std::to_string(shape.workgroup);
    if (shape.at_once > 0) name += ':' + std::to_string(shape.at_once);
    return name;
}

}  // namespace tissuewarp::tled
