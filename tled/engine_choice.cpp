#include "tled/engine_choice.hpp"

#include "shaders/device.hpp"

#include <string>

namespace tissuewarp::tled {

namespace {

/// Elements below which one step on the CPU costs less than the GPU's dispatches.
constexpr int least_elements_for_gpu = 20000;

}  // namespace

bool has_gpu() {
    return shaders::has_hardware_device();
}

std::unique_ptr<Engine> make_suitable_engine(const RestState& rest, int gpu_index, Observer& observer) {
    if (rest.element_count() < least_elements_for_gpu || !has_gpu()) return make_cpu_engine(rest, Scalar::Float32);
    try {
        return make_gpu_engine(rest, gpu_index);
    } catch (const GpuUnavailable& reason) {
        observer.note(std::string("the CPU takes over from the GPU: ") + reason.what());
        return make_cpu_engine(rest, Scalar::Float32);
    }
}

}  // namespace tissuewarp::tled
