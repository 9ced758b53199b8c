#include "shaders/readback.hpp"

#include "shaders/detail/gl.hpp"

#include <algorithm>
#include <array>

namespace tissuewarp::shaders {

namespace {

/// Where the next piece may begin.
std::size_t rounded(std::size_t bytes) {
    constexpr std::size_t alignment = 16;
    return (bytes + alignment - 1) / alignment * alignment;
}

}  // namespace

Readback::Readback(const Device& device, std::size_t bytes, std::string what)
    : device_(device), bytes_(bytes), what_(std::move(what)) {
    const CurrentContext current = device.make_current();
    const auto allocated = static_cast<GLsizeiptr>(std::max<std::size_t>(bytes, 16));
    constexpr GLbitfield access = GL_MAP_READ_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    glCreateBuffers(1, &id_);
    glNamedBufferStorage(id_, allocated, nullptr, access | GL_CLIENT_STORAGE_BIT);
    mapped_ = static_cast<const std::byte*>(glMapNamedBufferRange(id_, 0, allocated, access));
    try {
        check_errors("mapping of " + what_);
        if (mapped_ == nullptr)
            throw GpuUnavailable("mapping of " + what_ + ": the driver gives no memory for " + std::to_string(bytes) +
                                 " bytes; take a coarser grid or the CPU");
    } catch (...) {
        glDeleteBuffers(1, &id_);
        throw;
    }
}

Readback::~Readback() {
    detail::release_with_context(device_, [this] {
        glUnmapNamedBuffer(id_);
        glDeleteBuffers(1, &id_);
    });
}

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
        if (first + bytes > bytes_)
            throw InvalidInput(std::to_string(bytes) + " bytes of " + source.what_ + " for " + what_ + ", which hold " +
                               std::to_string(bytes_ - first));
        fetched.emplace_back(mapped_ + first, bytes);
        if (bytes == 0) continue;
        glCopyNamedBufferSubData(source.id_, id_, 0, static_cast<GLintptr>(first), static_cast<GLsizeiptr>(bytes));
        first += rounded(bytes);
    }
    glMemoryBarrier(GL_CLIENT_MAPPED_BUFFER_BARRIER_BIT);
    glFinish();
    check_errors("download into " + what_);
    return fetched;
}

}  // namespace tissuewarp::shaders
