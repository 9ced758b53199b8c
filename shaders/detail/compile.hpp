#pragma once
/// From GLSL text to a linked program. Internal to shaders/.

#include "shaders/program_source.hpp"

#include <epoxy/gl.h>

#include <vector>

namespace tissuewarp::shaders::detail {

struct StageText {
    GLenum stage;  ///< GL_COMPUTE_SHADER, GL_VERTEX_SHADER or GL_FRAGMENT_SHADER
    const ComposedSource* source;
};

/// Compiles and links in the current context; the caller owns the program. Throws GpuUnavailable with file:line and the
/// compiler's words when the driver refuses a text.
GLuint linked_program(const std::vector<StageText>& stages);

}  // namespace tissuewarp::shaders::detail
