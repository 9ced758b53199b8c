#include "shaders/program.hpp"

#include "shaders/detail/compile.hpp"
#include "shaders/detail/gl.hpp"

#include <algorithm>
#include <array>

namespace tissuewarp::shaders {
namespace {

std::vector<StorageBlock> storage_blocks_of(GLuint program) {
    GLint count = 0;
    glGetProgramInterfaceiv(program, GL_SHADER_STORAGE_BLOCK, GL_ACTIVE_RESOURCES, &count);
    std::vector<StorageBlock> blocks;
    for (GLuint i = 0; i < static_cast<GLuint>(count); ++i) {
        std::array<char, 256> name{};
        glGetProgramResourceName(program, GL_SHADER_STORAGE_BLOCK, i, static_cast<GLsizei>(name.size()), nullptr,
                                 name.data());
        const GLenum property = GL_BUFFER_BINDING;
        GLint binding = 0;
        glGetProgramResourceiv(program, GL_SHADER_STORAGE_BLOCK, i, 1, &property, 1, nullptr, &binding);
        blocks.push_back({name.data(), binding});
    }
    std::sort(blocks.begin(), blocks.end(), [](const auto& a, const auto& b) { return a.binding < b.binding; });
    return blocks;
}

}  // namespace

Program::Program(const Device& device, const ComposedSource& source)
    : device_(device), files_(source.files.begin() + 1, source.files.end()) {
    const CurrentContext current = device.make_current();
    id_ = detail::linked_program({{GL_COMPUTE_SHADER, &source}});
    std::array<GLint, 3> size{1, 1, 1};
    glGetProgramiv(id_, GL_COMPUTE_WORK_GROUP_SIZE, size.data());
    workgroup_size_ = size[0] * size[1] * size[2];
    blocks_ = storage_blocks_of(id_);
    check_errors("link of " + source.files.back());
}

Program::~Program() {
    detail::release_with_context(device_, [this] { glDeleteProgram(id_); });
}

void Program::set(int location, std::uint32_t value) const {
    glProgramUniform1ui(id_, location, value);
}
void Program::set(int location, float value) const {
    glProgramUniform1f(id_, location, value);
}

void Program::dispatch(std::size_t invocations) const {
    if (invocations == 0) return;
    const auto size = static_cast<std::size_t>(workgroup_size_);
    const std::size_t groups = (invocations + size - 1) / size;
    // A row of groups is limited (65535 on many drivers): the rest goes to further rows.
    const std::size_t row = std::min(groups, static_cast<std::size_t>(device_.limits().workgroup_count[0]));
    glUseProgram(id_);
    glDispatchCompute(static_cast<GLuint>(row), static_cast<GLuint>((groups + row - 1) / row), 1);
}

const Program& ProgramCache::get(const ProgramSource& source) {
    std::unique_ptr<Program>& program = programs_[program_key(source)];
    if (program == nullptr) program = std::make_unique<Program>(device_, compose(source));
    return *program;
}

}  // namespace tissuewarp::shaders
