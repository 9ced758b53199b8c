#include "shaders/device.hpp"

#include "core/errors.hpp"
#include "shaders/detail/egl.hpp"
#include "shaders/detail/gl.hpp"

#include <algorithm>

namespace tissuewarp::shaders {

struct CurrentContext::Previous {
    EGLDisplay own_display = EGL_NO_DISPLAY;
    EGLDisplay display = EGL_NO_DISPLAY;
    EGLContext context = EGL_NO_CONTEXT;
    EGLSurface draw = EGL_NO_SURFACE, read = EGL_NO_SURFACE;
};

CurrentContext::CurrentContext(std::unique_ptr<Previous> previous) : previous_(std::move(previous)) {}
CurrentContext::CurrentContext(CurrentContext&& other) noexcept = default;

CurrentContext::~CurrentContext() {
    if (previous_ == nullptr) return;
    eglBindAPI(EGL_OPENGL_API);
    if (previous_->context == EGL_NO_CONTEXT)
        eglMakeCurrent(previous_->own_display, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    else
        eglMakeCurrent(previous_->display, previous_->draw, previous_->read, previous_->context);
}

struct Device::Context {
    explicit Context(detail::DisplayContext context) : made(context) {}
    ~Context() { detail::destroy(made); }
    Context(const Context&) = delete;
    Context& operator=(const Context&) = delete;
    detail::DisplayContext made;
};

namespace {

bool software_renderer(const std::string& renderer) {
    for (const char* name : {"llvmpipe", "softpipe", "swrast", "SWR", "Software Rasterizer"})
        if (renderer.find(name) != std::string::npos) return true;
    return false;
}

std::string gl_string(GLenum name) {
    const auto* text = reinterpret_cast<const char*>(glGetString(name));
    return text == nullptr ? "unknown" : text;
}

int gl_int(GLenum name) {
    GLint value = 0;
    glGetIntegerv(name, &value);
    return value;
}

/// Hardware first, then software, each in the order of EGL.
std::vector<int> order_of_choice(const std::vector<detail::Candidate>& candidates) {
    std::vector<int> order(candidates.size());
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = static_cast<int>(i);
    std::stable_partition(order.begin(), order.end(),
                          [&](int i) { return candidates[static_cast<std::size_t>(i)].hardware; });
    return order;
}

constexpr const char* cpu_remedy = "the CPU engine needs no GPU";

}  // namespace

Device::Device(int index, Debugging debugging) {
    const detail::Candidates candidates = detail::enumerate();
    const int count = static_cast<int>(candidates.list.size());
    if (count == 0) throw GpuUnavailable("no GPU: " + candidates.problem + "; " + cpu_remedy);
    if (index < -1 || index >= count)
        throw GpuUnavailable("GPU device " + std::to_string(index) + " does not exist: EGL has " +
                             std::to_string(count) + " device(s), counted from 0; −1 chooses");
    std::string problems;
    for (const int i : index >= 0 ? std::vector<int>{index} : order_of_choice(candidates.list)) {
        try {
            const detail::Candidate& candidate = candidates.list[static_cast<std::size_t>(i)];
            context_ = std::make_unique<Context>(detail::make_context(candidate, debugging));
            const CurrentContext current = make_current();
            index_ = i;
            describe();
            hardware_ = candidate.hardware && !software_renderer(renderer_);
            if (debugging == Debugging::On) detail::collect_debug_messages();
            check_errors("start of " + candidate.name);
            return;
        } catch (const GpuUnavailable& error) {
            context_.reset();
            if (!problems.empty()) problems += " | ";
            problems += error.what();
        }
    }
    throw GpuUnavailable("no GPU with OpenGL 4.5: " + problems + "; " + cpu_remedy);
}

Device::~Device() = default;

CurrentContext Device::make_current() const {
    const detail::DisplayContext& made = context_->made;
    eglBindAPI(EGL_OPENGL_API);
    if (eglGetCurrentContext() == made.context) return CurrentContext(nullptr);
    auto previous = std::make_unique<CurrentContext::Previous>();
    previous->own_display = made.display;
    previous->context = eglGetCurrentContext();
    if (previous->context != EGL_NO_CONTEXT) {
        previous->display = eglGetCurrentDisplay();
        previous->draw = eglGetCurrentSurface(EGL_DRAW);
        previous->read = eglGetCurrentSurface(EGL_READ);
    }
    if (eglMakeCurrent(made.display, EGL_NO_SURFACE, EGL_NO_SURFACE, made.context) != EGL_TRUE)
        throw GpuUnavailable("the OpenGL context cannot be used by this thread (" + detail::egl_error() +
                             "): another thread is using it; call an engine from one thread at a time");
    return CurrentContext(std::move(previous));
}

void Device::describe() {
    renderer_ = gl_string(GL_RENDERER);
    vendor_ = gl_string(GL_VENDOR);
    version_ = gl_string(GL_VERSION);
    GLint64 block = 0;
    glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &block);
    limits_.storage_buffer_bytes = static_cast<std::size_t>(block);
    limits_.shared_memory_bytes = static_cast<std::size_t>(gl_int(GL_MAX_COMPUTE_SHARED_MEMORY_SIZE));
    limits_.storage_blocks = gl_int(GL_MAX_COMPUTE_SHADER_STORAGE_BLOCKS);
    limits_.storage_bindings = gl_int(GL_MAX_SHADER_STORAGE_BUFFER_BINDINGS);
    limits_.workgroup_invocations = gl_int(GL_MAX_COMPUTE_WORK_GROUP_INVOCATIONS);
    limits_.texture_size = gl_int(GL_MAX_TEXTURE_SIZE);
    for (unsigned axis = 0; axis < 3; ++axis)
        glGetIntegeri_v(GL_MAX_COMPUTE_WORK_GROUP_COUNT, axis, &limits_.workgroup_count[axis]);
    if (epoxy_has_gl_extension("GL_KHR_shader_subgroup")) limits_.subgroup_size = gl_int(GL_SUBGROUP_SIZE_KHR);
    if (epoxy_has_gl_extension("GL_NV_shader_thread_group")) limits_.multiprocessors = gl_int(GL_SM_COUNT_NV);
}

std::vector<DeviceInfo> list_devices() {
    const detail::Candidates candidates = detail::enumerate();
    std::vector<DeviceInfo> devices;
    for (int i = 0; i < static_cast<int>(candidates.list.size()); ++i) {
        const detail::Candidate& candidate = candidates.list[static_cast<std::size_t>(i)];
        DeviceInfo info{i, candidate.name, candidate.hardware, ""};
        try {
            const Device device(i);
            info.name = device.renderer();
            info.hardware = device.hardware();
        } catch (const GpuUnavailable& error) {
            info.problem = error.what();
        }
        devices.push_back(std::move(info));
    }
    return devices;
}

bool has_hardware_device() {
    const detail::Candidates candidates = detail::enumerate();
    for (int i = 0; i < static_cast<int>(candidates.list.size()); ++i) {
        if (!candidates.list[static_cast<std::size_t>(i)].hardware) continue;
        try {
            if (Device(i).hardware()) return true;
        } catch (const GpuUnavailable&) {  // another may do
        }
    }
    return false;
}

}  // namespace tissuewarp::shaders
