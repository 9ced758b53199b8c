#pragma once
/// EGL displays and contexts without a window system. Internal to shaders/.

#include "shaders/device.hpp"

#include <epoxy/egl.h>

#include <string>
#include <vector>

namespace tissuewarp::shaders::detail {

/// A place that can give a display: an EGL device, or Mesa's surfaceless platform where devices cannot be enumerated.
struct Candidate {
    EGLDeviceEXT device = EGL_NO_DEVICE_EXT;
    bool hardware = false;
    std::string name;
};

/// Empty with a reason when there is no EGL.
struct Candidates {
    std::vector<Candidate> list;
    std::string problem;
};
Candidates enumerate();

struct DisplayContext {
    EGLDisplay display = EGL_NO_DISPLAY;
    EGLContext context = EGL_NO_CONTEXT;
};

/// An OpenGL 4.5 core context; throws GpuUnavailable with the step that failed.
DisplayContext make_context(const Candidate& candidate, Debugging debugging);
void destroy(const DisplayContext& made);

/// The symbolic name of eglGetError().
std::string egl_error();

}  // namespace tissuewarp::shaders::detail
