#include "shaders/readback.hpp"

#include "shaders/detail/mapped_buffer.hpp"

#include <array>
#include <utility>

namespace tissuewarp::shaders {

namespace {

/// Where the next piece may begin.
std::size_t rounded(std::size_t bytes) {
    constexpr std::size_t alignment = 16;
    return (bytes + alignment - 1) / alignment * alignment;
}

}  // namespace

Readback::Readback(const Device& device, std::size_t bytes, std::string what)
    : memory_(std::make_unique<detail::MappedBuffer>(device, bytes, std::move(what), GL_MAP_READ_BIT)) {}

Readback::~Readback() = default;

std::span<const std::byte> Readback::fetch(const StorageBuffer& source, std::size_t bytes) {
    return fetch(std::array{Piece{source, bytes}}).front();
}

std::size_t Readback::bytes_of(std::span<const Piece> pieces) {
    std::size_t bytes = 0;
    for (const Piece& piece : pieces) bytes += rounded(piece.bytes);
    return bytes;
}

std::vector<std::span<const std::byte>> Readback::fetch(std::span<const Piece> pieces) {
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    std::vector<std::span<const std::byte>> fetched;
    std::size_t first = 0;
    for (const auto& [source, bytes] : pieces) {
        source.require_range(0, bytes);
        if (first + bytes > memory_->bytes())
            throw InvalidInput(std::to_string(bytes) + " bytes of " + source.what_ + " for " + memory_->what() +
                               ", which hold " + std::to_string(memory_->bytes() - first));
        fetched.emplace_back(memory_->data() + first, bytes);
        if (bytes == 0) continue;
        glCopyNamedBufferSubData(source.id_, memory_->id(), 0, static_cast<GLintptr>(first),
                                 static_cast<GLsizeiptr>(bytes));
        first += rounded(bytes);
    }
    glMemoryBarrier(GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
    glFinish();
    check_errors("download into " + memory_->what());
    return fetched;
}

}  // namespace tissuewarp::shaders
