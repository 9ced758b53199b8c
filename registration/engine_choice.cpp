#include "registration/detail/engine_choice.hpp"

#include "shaders/device.hpp"

#include <algorithm>

namespace tissuewarp::registration::detail {

namespace {

/// Elements below which one step on the CPU costs less than the GPU's dispatches.
constexpr int least_elements_for_gpu = 20000;

bool has_gpu() {
    const auto devices = shaders::list_devices();
    return std::any_of(devices.begin(), devices.end(),
                       [](const shaders::DeviceInfo& device) { return device.hardware && device.problem.empty(); });
}

}  // namespace

std::unique_ptr<tled::Engine> make_engine(const PreparedModel& prepared, const UpdateOptions& options,
                                          Observer& observer) {
    if (options.device == Device::Gpu) return tled::make_gpu_engine(prepared.rest, options.gpu_index);
    const bool gpu =
        options.device == Device::Auto && prepared.rest.element_count() >= least_elements_for_gpu && has_gpu();
    if (!gpu) return tled::make_cpu_engine(prepared.rest, tled::Scalar::Float32);
    try {
        return tled::make_gpu_engine(prepared.rest, options.gpu_index);
    } catch (const GpuUnavailable& reason) {
        observer.note(std::string("the CPU takes over from the GPU: ") + reason.what());
        return tled::make_cpu_engine(prepared.rest, tled::Scalar::Float32);
    }
}

std::unique_ptr<DenseEngine> make_dense_engine(const PreparedModel& prepared, const UpdateOptions& options,
                                               Observer& observer) {
    if (options.device == Device::Gpu) return make_gpu_dense_engine(prepared, options.gpu_index);
    if (options.device == Device::Cpu || !has_gpu()) return make_cpu_dense_engine(prepared);
    try {
        return make_gpu_dense_engine(prepared, options.gpu_index);
    } catch (const GpuUnavailable& reason) {
        observer.note(std::string("the CPU takes over the image's forces from the GPU: ") + reason.what());
        return make_cpu_dense_engine(prepared);
    }
}

}  // namespace tissuewarp::registration::detail
