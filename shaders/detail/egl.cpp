#include "shaders/detail/egl.hpp"

#include "core/errors.hpp"

#include <dlfcn.h>

#include <array>
#include <cstdio>
#include <string_view>

namespace tissuewarp::shaders::detail {
namespace {

bool has_extension(const char* extensions, std::string_view name) {
    return extensions != nullptr && epoxy_extension_in_string(extensions, std::string(name).c_str());
}

/// libepoxy ends the process when it cannot load libGL, so look before it does.
bool opengl_library_present() {
    for (const char* name : {"libOpenGL.so.0", "libGL.so.1"})
        if (void* handle = dlopen(name, RTLD_LAZY | RTLD_LOCAL)) {
            dlclose(handle);
            return true;
        }
    return false;
}

Candidate describe(EGLDeviceEXT device, int index) {
    const char* extensions = eglQueryDeviceStringEXT(device, EGL_EXTENSIONS);
    Candidate candidate;
    candidate.device = device;
    candidate.hardware = !has_extension(extensions, "EGL_MESA_device_software") &&
                         (has_extension(extensions, "EGL_EXT_device_drm") ||
                          has_extension(extensions, "EGL_EXT_device_drm_render_node") ||
                          has_extension(extensions, "EGL_NV_device_cuda"));
    candidate.name = "EGL device " + std::to_string(index);
    if (has_extension(extensions, "EGL_EXT_device_drm"))
        if (const char* node = eglQueryDeviceStringEXT(device, EGL_DRM_DEVICE_FILE_EXT))
            candidate.name += std::string(" (") + node + ")";
    return candidate;
}

EGLDisplay display_of(const Candidate& candidate) {
    if (candidate.device != EGL_NO_DEVICE_EXT)
        return eglGetPlatformDisplayEXT(EGL_PLATFORM_DEVICE_EXT, candidate.device, nullptr);
    return eglGetPlatformDisplayEXT(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
}

[[noreturn]] void refuse(const Candidate& candidate, const std::string& what, const std::string& remedy) {
    throw GpuUnavailable(candidate.name + ": " + what + "; " + remedy);
}

}  // namespace

std::string egl_error() {
    const EGLint error = eglGetError();
    switch (error) {
        case EGL_SUCCESS:
            return "no EGL error given";
        case EGL_NOT_INITIALIZED:
            return "EGL_NOT_INITIALIZED";
        case EGL_BAD_ACCESS:
            return "EGL_BAD_ACCESS";
        case EGL_BAD_ALLOC:
            return "EGL_BAD_ALLOC";
        case EGL_BAD_ATTRIBUTE:
            return "EGL_BAD_ATTRIBUTE";
        case EGL_BAD_CONTEXT:
            return "EGL_BAD_CONTEXT";
        case EGL_BAD_MATCH:
            return "EGL_BAD_MATCH";
        case EGL_BAD_PARAMETER:
            return "EGL_BAD_PARAMETER";
        case EGL_CONTEXT_LOST:
            return "EGL_CONTEXT_LOST";
        default:
            break;
    }
    std::array<char, 16> text{};
    std::snprintf(text.data(), text.size(), "EGL 0x%04x", static_cast<unsigned>(error));
    return text.data();
}

Candidates enumerate() {
    if (!epoxy_has_egl()) return {{}, "libEGL.so.1 is not installed (Debian: libegl1)"};
    if (!opengl_library_present())
        return {{}, "neither libOpenGL.so.0 nor libGL.so.1 is installed (Debian: libopengl0)"};
    const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
    Candidates found;
    if (has_extension(client, "EGL_EXT_platform_device") &&
        (has_extension(client, "EGL_EXT_device_enumeration") || has_extension(client, "EGL_EXT_device_base"))) {
        EGLint count = 0;
        if (eglQueryDevicesEXT(0, nullptr, &count) == EGL_TRUE && count > 0) {
            std::vector<EGLDeviceEXT> devices(static_cast<std::size_t>(count));
            eglQueryDevicesEXT(count, devices.data(), &count);
            for (int i = 0; i < count; ++i) found.list.push_back(describe(devices[static_cast<std::size_t>(i)], i));
        }
    }
    if (found.list.empty() && has_extension(client, "EGL_MESA_platform_surfaceless"))
        found.list.push_back({EGL_NO_DEVICE_EXT, false, "EGL surfaceless platform"});
    if (found.list.empty())
        found.problem =
            "EGL offers neither devices nor a surfaceless platform; install the vendor's EGL driver, or "
            "Mesa's software one (Debian: libegl-mesa0, libgl1-mesa-dri)";
    return found;
}

DisplayContext make_context(const Candidate& candidate, Debugging debugging) {
    DisplayContext made;
    made.display = display_of(candidate);
    if (made.display == EGL_NO_DISPLAY) refuse(candidate, "no display (" + egl_error() + ")", "check its driver");
    EGLint major = 0;
    EGLint minor = 0;
    // A display is shared by all contexts of the process on that device and its initialisation is not counted, so it is
    // never terminated.
    if (eglInitialize(made.display, &major, &minor) != EGL_TRUE)
        refuse(candidate, "the display does not start (" + egl_error() + ")",
               "check its driver and the access rights of the device files");
    const char* extensions = eglQueryString(made.display, EGL_EXTENSIONS);
    for (const char* needed : {"EGL_KHR_surfaceless_context", "EGL_KHR_no_config_context"})
        if (!has_extension(extensions, needed))
            refuse(candidate, std::string("its EGL lacks ") + needed, "a newer driver is needed");
    if (eglBindAPI(EGL_OPENGL_API) != EGL_TRUE)
        refuse(candidate, "its EGL has no desktop OpenGL", "take another device");
    const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                                 4,
                                 EGL_CONTEXT_MINOR_VERSION,
                                 5,
                                 EGL_CONTEXT_OPENGL_PROFILE_MASK,
                                 EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                                 EGL_CONTEXT_OPENGL_DEBUG,
                                 debugging == Debugging::On ? EGL_TRUE : EGL_FALSE,
                                 EGL_NONE};
    made.context = eglCreateContext(made.display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
    if (made.context == EGL_NO_CONTEXT)
        refuse(candidate, "no OpenGL 4.5 core context (" + egl_error() + ")",
               "a newer driver or another device is needed");
    return made;
}

void destroy(const DisplayContext& made) {
    if (made.context != EGL_NO_CONTEXT) eglDestroyContext(made.display, made.context);
}

}  // namespace tissuewarp::shaders::detail
