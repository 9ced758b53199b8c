#include "shaders/detail/gl.hpp"

#include "core/errors.hpp"
#include "shaders/device.hpp"

#include <utility>

namespace tissuewarp::shaders {
namespace detail {
namespace {

thread_local std::string messages;

void on_message(GLenum /*source*/, GLenum type, GLuint /*id*/, GLenum severity, GLsizei length, const GLchar* text,
                const void* /*user*/) {
    if (type != GL_DEBUG_TYPE_ERROR && severity != GL_DEBUG_SEVERITY_HIGH) return;
    if (!messages.empty()) messages += "; ";
    messages.append(text, static_cast<std::size_t>(length));
}

}  // namespace

void collect_debug_messages() {
    glEnable(GL_DEBUG_OUTPUT);
    glEnable(GL_DEBUG_OUTPUT_SYNCHRONOUS);
    glDebugMessageCallback(on_message, nullptr);
}

std::string take_debug_messages() {
    return std::exchange(messages, {});
}

}  // namespace detail

namespace {

const char* error_name(GLenum error) {
    switch (error) {
        case GL_INVALID_ENUM:
            return "GL_INVALID_ENUM";
        case GL_INVALID_VALUE:
            return "GL_INVALID_VALUE";
        case GL_INVALID_OPERATION:
            return "GL_INVALID_OPERATION";
        case GL_OUT_OF_MEMORY:
            return "GL_OUT_OF_MEMORY";
        case GL_CONTEXT_LOST:
            return "GL_CONTEXT_LOST";
        default:
            return "an unknown OpenGL error";
    }
}

}  // namespace

void check_errors(std::string_view where) {
    const GLenum error = glGetError();
    if (error == GL_NO_ERROR) return;
    // A lost context reports its loss for ever: a bound keeps this from spinning.
    for (int i = 0; i < 16 && glGetError() != GL_NO_ERROR; ++i) {
    }
    std::string message = std::string(where) + ": " + error_name(error);
    const std::string words = detail::take_debug_messages();
    if (!words.empty()) message += " (" + words + ")";
    if (error == GL_OUT_OF_MEMORY) message += "; take a coarser mesh, a larger device or the CPU engine";
    if (error == GL_CONTEXT_LOST) message += "; the driver reset the device: start again";
    throw GpuUnavailable(message);
}

void finish() {
    glFinish();
}
void flush() {
    glFlush();
}
void storage_barrier() {
    glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

}  // namespace tissuewarp::shaders
