#include "shaders/texture.hpp"

#include "shaders/detail/gl.hpp"

#include <cmath>

namespace tissuewarp::shaders {
namespace {

/// Sized format of the texture; format and type of its transfers; bytes of a texel.
struct TransferFormat {
    GLenum sized, components, type;
    std::size_t bytes;
};

TransferFormat transfer_format(TexelFormat format) {
    switch (format) {
        case TexelFormat::Uint:
            return {GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, 4};
        case TexelFormat::Uint2:
            return {GL_RG32UI, GL_RG_INTEGER, GL_UNSIGNED_INT, 8};
        case TexelFormat::Uint4:
            return {GL_RGBA32UI, GL_RGBA_INTEGER, GL_UNSIGNED_INT, 16};
        case TexelFormat::Float4:
            break;
    }
    return {GL_RGBA32F, GL_RGBA, GL_FLOAT, 16};
}

/// What chunks/texels.glsl has bits for.
constexpr int largest_side = 1 << 15;

}  // namespace

TextureShape texture_shape(const Device& device, std::size_t count, const std::string& what) {
    const auto width =
        static_cast<std::size_t>(std::ceil(std::sqrt(static_cast<double>(std::max<std::size_t>(count, 1)))));
    const auto limit = static_cast<std::size_t>(std::min(device.limits().texture_size, largest_side));
    if (width > limit)
        throw GpuUnavailable(what + " take a texture of " + std::to_string(width) + " by " + std::to_string(width) +
                             " texels, " + device.renderer() + " has " + std::to_string(limit) +
                             "; take a coarser mesh or the compute engine");
    const std::size_t height = std::max<std::size_t>((count + width - 1) / width, 1);
    return {static_cast<int>(width), static_cast<int>(height)};
}

TextureStorage::TextureStorage(const Device& device, TexelFormat format, std::size_t count, std::string what)
    : device_(device), format_(format), what_(std::move(what)), shape_(texture_shape(device, count, what_)) {
    const CurrentContext current = device.make_current();
    const TransferFormat transfer = transfer_format(format);
    glCreateTextures(GL_TEXTURE_2D, 1, &id_);
    try {
        glTextureStorage2D(id_, 1, transfer.sized, shape_.width, shape_.height);
        // Filters other than these make a texture of integers incomplete, even for texelFetch.
        glTextureParameteri(id_, GL_TEXTURE_MIN_FILTER, GL_NEAREST);
        glTextureParameteri(id_, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
        check_errors("texture for " + what_);
        write(std::vector<std::byte>(shape_.texels() * transfer.bytes));
    } catch (...) {
        glDeleteTextures(1, &id_);
        throw;
    }
}

TextureStorage::~TextureStorage() {
    detail::release_with_context(device_, [this] { glDeleteTextures(1, &id_); });
}

void TextureStorage::write(std::span<const std::byte> texels) {
    const TransferFormat transfer = transfer_format(format_);
    glTextureSubImage2D(id_, 0, 0, 0, shape_.width, shape_.height, transfer.components, transfer.type, texels.data());
    check_errors("upload of " + what_);
}

void TextureStorage::read(std::span<std::byte> texels) const {
    const TransferFormat transfer = transfer_format(format_);
    glGetTextureImage(id_, 0, transfer.components, transfer.type, static_cast<GLsizei>(texels.size()), texels.data());
    check_errors("download of " + what_);
}

void TextureStorage::bind(int unit) const {
    glBindTextureUnit(static_cast<GLuint>(unit), id_);
}

}  // namespace tissuewarp::shaders
