#include "shaders/upload.hpp"

#include "shaders/detail/mapped_buffer.hpp"

#include <utility>

namespace tissuewarp::shaders {

Upload::Upload(const Device& device, std::size_t bytes, std::string what)
    : memory_(std::make_unique<detail::MappedBuffer>(device, bytes, std::move(what), GL_MAP_WRITE_BIT)) {}

Upload::~Upload() {
    if (sent_ != nullptr)
        detail::release_with_context(memory_->device(), [this] { glDeleteSync(static_cast<GLsync>(sent_)); });
}

std::size_t Upload::bytes() const {
    return memory_->bytes();
}

std::span<std::byte> Upload::room() {
    if (sent_ != nullptr) {
        glClientWaitSync(static_cast<GLsync>(sent_), GL_SYNC_FLUSH_COMMANDS_BIT, ~GLuint64{0});
        glDeleteSync(static_cast<GLsync>(std::exchange(sent_, nullptr)));
    }
    return {memory_->data(), memory_->bytes()};
}

void Upload::send(const StorageBuffer& target, std::size_t bytes) {
    target.require_range(0, bytes);
    if (bytes > memory_->bytes())
        throw InvalidInput(std::to_string(bytes) + " bytes for " + target.what() + " from " + memory_->what() +
                           ", which hold " + std::to_string(memory_->bytes()));
    if (bytes == 0) return;
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT | GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
    glCopyNamedBufferSubData(memory_->id(), target.id_, 0, 0, static_cast<GLsizeiptr>(bytes));
    if (sent_ != nullptr) glDeleteSync(static_cast<GLsync>(sent_));
    sent_ = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    check_errors("upload of " + target.what());
}

}  // namespace tissuewarp::shaders
