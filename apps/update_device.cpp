#include "apps/update_device.hpp"

#include <charconv>

namespace tissuewarp::apps {

registration::UpdateOptions on_device(const DeviceChoice& device) {
    using registration::Device;
    registration::UpdateOptions result;
    const std::string& name = device.name;
    if (name == "cpu") result.device = Device::Cpu;
    if (name.starts_with("gpu")) result.device = Device::Gpu;
    if (name.starts_with("gpu:")) std::from_chars(name.data() + 4, name.data() + name.size(), result.gpu_index);
    return result;
}

}  // namespace tissuewarp::apps
