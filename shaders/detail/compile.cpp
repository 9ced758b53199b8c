#include "shaders/detail/compile.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <string>

namespace tissuewarp::shaders::detail {
namespace {

template <class GetParameter, class GetLog>
std::string log_of(GLuint object, GetParameter get_parameter, GetLog get_log) {
    GLint length = 0;
    get_parameter(object, GL_INFO_LOG_LENGTH, &length);
    std::string log(static_cast<std::size_t>(std::max(length, 1)), '\0');
    GLsizei written = 0;
    get_log(object, length, &written, log.data());
    log.resize(static_cast<std::size_t>(written));
    return log;
}

/// Attaches one compiled shader, which goes with the program.
void attach(GLuint program, const StageText& stage) {
    const GLuint shader = glCreateShader(stage.stage);
    const char* text = stage.source->text.c_str();
    glShaderSource(shader, 1, &text, nullptr);
    glCompileShader(shader);
    GLint compiled = GL_FALSE;
    glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
    if (compiled == GL_TRUE) glAttachShader(program, shader);
    const std::string log = compiled == GL_TRUE ? "" : log_of(shader, glGetShaderiv, glGetShaderInfoLog);
    glDeleteShader(shader);  // an attached one stays until its program goes
    if (compiled != GL_TRUE)
        throw GpuUnavailable("the driver refuses " + stage.source->files.back() + ":\n" +
                             readable_log(log, stage.source->files));
}

void link(GLuint program, const std::vector<StageText>& stages) {
    for (const StageText& stage : stages) attach(program, stage);
    glLinkProgram(program);
    GLint linked = GL_FALSE;
    glGetProgramiv(program, GL_LINK_STATUS, &linked);
    if (linked == GL_TRUE) return;
    const ComposedSource& last = *stages.back().source;
    throw GpuUnavailable("the driver does not link " + last.files.back() + ":\n" +
                         readable_log(log_of(program, glGetProgramiv, glGetProgramInfoLog), last.files));
}

}  // namespace

GLuint linked_program(const std::vector<StageText>& stages) {
    const GLuint program = glCreateProgram();
    try {
        link(program, stages);
    } catch (...) {
        glDeleteProgram(program);
        throw;
    }
    return program;
}

}  // namespace tissuewarp::shaders::detail
