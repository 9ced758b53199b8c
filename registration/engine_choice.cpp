#include "registration/engine_choice.hpp"

#include "tled/engine_choice.hpp"

namespace tissuewarp::registration::detail {

std::unique_ptr<tled::Engine> make_engine(const PreparedModel& prepared, const UpdateOptions& options,
                                          Observer& observer) {
    if (options.device == Device::Gpu) return tled::make_gpu_engine(prepared.rest, options.gpu_index);
    if (options.device == Device::Cpu) return tled::make_cpu_engine(prepared.rest, tled::Scalar::Float32);
    return tled::make_suitable_engine(prepared.rest, options.gpu_index, observer);
}

std::unique_ptr<ImageEngine> make_image_engine(const meshing::TetMesh& mesh, const ImageModel& image,
                                               const UpdateOptions& options, Observer& observer) {
    if (options.device == Device::Gpu) return make_gpu_image_engine(mesh, image, options.gpu_index);
    if (options.device == Device::Cpu || !tled::has_gpu()) return make_cpu_image_engine(mesh, image);
    try {
        return make_gpu_image_engine(mesh, image, options.gpu_index);
    } catch (const GpuUnavailable& reason) {
        observer.note(std::string("the CPU takes over the image's forces from the GPU: ") + reason.what());
        return make_cpu_image_engine(mesh, image);
    }
}

}  // namespace tissuewarp::registration::detail
