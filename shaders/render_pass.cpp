#include "shaders/render_pass.hpp"

#include "core/errors.hpp"
#include "shaders/catalogue.hpp"
#include "shaders/detail/compile.hpp"
#include "shaders/detail/gl.hpp"

#include <algorithm>
#include <array>

namespace tissuewarp::shaders {
namespace {

/// Colour attachments that every driver of OpenGL 4.5 has.
constexpr std::size_t most_targets = 8;

TextureShape common_shape(const std::vector<const TextureStorage*>& targets) {
    if (targets.empty() || targets.size() > most_targets)
        throw InvalidInput("a render pass writes " + std::to_string(targets.size()) + " textures; it takes 1 to " +
                           std::to_string(most_targets));
    const TextureShape& first = targets.front()->shape();
    for (const TextureStorage* target : targets)
        if (target->shape().width != first.width || target->shape().height != first.height)
            throw InvalidInput("a render pass writes " + targets.front()->what() + " and " + target->what() +
                               ", whose textures differ in shape");
    return first;
}

bool is_sampler(GLint type) {
    return type == GL_SAMPLER_2D || type == GL_UNSIGNED_INT_SAMPLER_2D;
}

std::vector<Sampler> samplers_of(GLuint program) {
    GLint count = 0;
    glGetProgramInterfaceiv(program, GL_UNIFORM, GL_ACTIVE_RESOURCES, &count);
    std::vector<Sampler> samplers;
    for (GLuint i = 0; i < static_cast<GLuint>(count); ++i) {
        constexpr std::array<GLenum, 2> properties{GL_TYPE, GL_LOCATION};
        std::array<GLint, 2> values{};
        glGetProgramResourceiv(program, GL_UNIFORM, i, 2, properties.data(), 2, nullptr, values.data());
        if (!is_sampler(values[0])) continue;
        std::array<char, 256> name{};
        glGetProgramResourceName(program, GL_UNIFORM, i, static_cast<GLsizei>(name.size()), nullptr, name.data());
        GLint unit = 0;
        glGetUniformiv(program, values[1], &unit);
        samplers.push_back({name.data(), unit});
    }
    std::sort(samplers.begin(), samplers.end(), [](const auto& a, const auto& b) { return a.unit < b.unit; });
    return samplers;
}

}  // namespace

Framebuffer::Framebuffer(const Device& device, const std::vector<const TextureStorage*>& targets)
    : device_(device), shape_(common_shape(targets)) {
    const CurrentContext current = device.make_current();
    glCreateFramebuffers(1, &id_);
    std::vector<GLenum> outputs;
    for (const TextureStorage* target : targets) {
        outputs.push_back(GL_COLOR_ATTACHMENT0 + static_cast<GLenum>(outputs.size()));
        glNamedFramebufferTexture(id_, outputs.back(), target->id_, 0);
    }
    glNamedFramebufferDrawBuffers(id_, static_cast<GLsizei>(outputs.size()), outputs.data());
    const GLenum status = glCheckNamedFramebufferStatus(id_, GL_DRAW_FRAMEBUFFER);
    if (status == GL_FRAMEBUFFER_COMPLETE) return;
    glDeleteFramebuffers(1, &id_);
    throw GpuUnavailable(device.renderer() + " does not render to textures of " + targets.front()->what() +
                         " (status " + std::to_string(status) + "); take the compute engine");
}

Framebuffer::~Framebuffer() {
    detail::release_with_context(device_, [this] { glDeleteFramebuffers(1, &id_); });
}

void Framebuffer::bind() const {
    glBindFramebuffer(GL_DRAW_FRAMEBUFFER, id_);
    glViewport(0, 0, shape_.width, shape_.height);
}

FragmentProgram::FragmentProgram(const Device& device, const ComposedSource& fragment) : device_(device) {
    const CurrentContext current = device.make_current();
    const ComposedSource vertices = compose(full_screen_vertices());
    id_ = detail::linked_program({{GL_VERTEX_SHADER, &vertices}, {GL_FRAGMENT_SHADER, &fragment}});
    glCreateVertexArrays(1, &no_attributes_);  // the core profile draws nothing without one
    samplers_ = samplers_of(id_);
    check_errors("link of " + fragment.files.back());
}

FragmentProgram::~FragmentProgram() {
    detail::release_with_context(device_, [this] {
        glDeleteVertexArrays(1, &no_attributes_);
        glDeleteProgram(id_);
    });
}

void FragmentProgram::set(int location, float value) const {
    glProgramUniform1f(id_, location, value);
}

void FragmentProgram::draw(const Framebuffer& target) const {
    target.bind();
    glUseProgram(id_);
    glBindVertexArray(no_attributes_);
    glDrawArrays(GL_TRIANGLES, 0, 3);
}

}  // namespace tissuewarp::shaders
