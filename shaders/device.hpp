#pragma once
/// A device that computes with OpenGL 4.5 core, found through EGL: no display, no window system.

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::shaders {

/// One EGL device. `index` is what Device takes.
struct DeviceInfo {
    int index = 0;
    std::string name;       ///< renderer string of OpenGL, or the driver's name where no context could be made
    bool hardware = false;  ///< false for software rasterisers (llvmpipe, softpipe)
    std::string problem;    ///< empty when the device offers OpenGL 4.5 core, the reason otherwise
};

/// All EGL devices, hardware and software, usable or not; empty when there is no EGL at all. Makes a short-lived
/// context on each, which takes a fraction of a second per device.
std::vector<DeviceInfo> list_devices();

/// Whether one of them is hardware and usable. Software ones are not opened, whose compiler takes 50 MB.
bool has_hardware_device();

struct DeviceLimits {
    std::size_t shared_memory_bytes = 0;   ///< per workgroup
    std::size_t storage_buffer_bytes = 0;  ///< largest storage block
    int storage_blocks = 0;                ///< of one compute shader
    int storage_bindings = 0;              ///< of the context
    int workgroup_invocations = 0;
    std::array<int, 3> workgroup_count{};
    int texture_size = 0;     ///< texels of a side
    int subgroup_size = 0;    ///< 0 without GL_KHR_shader_subgroup
    int multiprocessors = 0;  ///< 0 where unknown, that is without GL_NV_shader_thread_group
};

enum class Debugging { Off, On };  ///< On: a debug context; errors carry the driver's words

/// Makes a context current on the calling thread for its own lifetime and then gives the thread back what it had.
class CurrentContext {
public:
    CurrentContext(CurrentContext&& other) noexcept;
    CurrentContext(const CurrentContext&) = delete;
    CurrentContext& operator=(const CurrentContext&) = delete;
    CurrentContext& operator=(CurrentContext&&) = delete;
    ~CurrentContext();

private:
    friend class Device;
    struct Previous;
    explicit CurrentContext(std::unique_ptr<Previous> previous);
    std::unique_ptr<Previous> previous_;
};

/// An OpenGL context of its own on one device. Everything of this library that touches OpenGL needs it current; objects
/// that take a `const Device&` see to that themselves, and the device must outlive them. One thread at a time,
/// whichever.
class Device {
public:
    /// `index` counts list_devices(); −1 takes the first hardware device that offers OpenGL 4.5 core, or a software one
    /// when there is none. Throws GpuUnavailable.
    explicit Device(int index = -1, Debugging debugging = Debugging::Off);
    ~Device();
    Device(const Device&) = delete;
    Device& operator=(const Device&) = delete;

    /// Throws GpuUnavailable when another thread holds the context.
    [[nodiscard]] CurrentContext make_current() const;

    [[nodiscard]] int index() const { return index_; }
    [[nodiscard]] bool hardware() const { return hardware_; }
    [[nodiscard]] const std::string& renderer() const { return renderer_; }
    [[nodiscard]] const std::string& vendor() const { return vendor_; }
    /// OpenGL's version string, which ends with that of the driver: "4.6.0 NVIDIA 580.65", "4.5 (Core Profile) Mesa
    /// 22.3.6".
    [[nodiscard]] const std::string& version() const { return version_; }
    [[nodiscard]] const DeviceLimits& limits() const { return limits_; }

private:
    struct Context;
    void describe();

    std::unique_ptr<Context> context_;
    int index_ = -1;
    bool hardware_ = false;
    std::string renderer_, vendor_, version_;
    DeviceLimits limits_;
};

/// Waits until the current context has done everything it was told.
void finish();
/// Hands what was recorded to the device without waiting.
void flush();
/// Storage written by earlier dispatches is visible to later dispatches. Buffers order their own transfers.
void storage_barrier();
/// Throws GpuUnavailable for an error pending in the current context; `where` names the operation for the message.
void check_errors(std::string_view where);

}  // namespace tissuewarp::shaders
