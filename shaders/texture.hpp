#pragma once
/// Lists in textures of two dimensions, as the render passes read and write them.

#include "core/errors.hpp"
#include "shaders/device.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::shaders {

/// Entry i of a list lies in column i % width and row i / width.
struct TextureShape {
    int width = 1, height = 1;
    [[nodiscard]] std::size_t texels() const {
        return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
    }
    /// Column and row of entry i in the form of chunks/texels.glsl: 15 bits each.
    [[nodiscard]] std::uint32_t coordinates(std::size_t i) const {
        const auto row = static_cast<std::size_t>(width);
        return static_cast<std::uint32_t>((i % row) | ((i / row) << 15U));
    }
};

/// The nearly square shape that holds `count` texels, because one row would soon exceed the device's longest side.
/// Throws GpuUnavailable, naming `what`, when a side exceeds the device's or 2¹⁵ texels.
TextureShape texture_shape(const Device& device, std::size_t count, const std::string& what);

enum class TexelFormat { Uint, Uint2, Uint4, Float4 };

/// A texture of one level. Members need the device's context current, except construction and destruction, which make
/// it so.
class TextureStorage {
public:
    /// Contents are zero. Throws GpuUnavailable for what texture_shape() refuses and when the memory is not there.
    TextureStorage(const Device& device, TexelFormat format, std::size_t count, std::string what);
    ~TextureStorage();
    TextureStorage(const TextureStorage&) = delete;
    TextureStorage& operator=(const TextureStorage&) = delete;

    /// Makes this the texture of that unit.
    void bind(int unit) const;

    [[nodiscard]] const TextureShape& shape() const { return shape_; }
    [[nodiscard]] const std::string& what() const { return what_; }

protected:
    /// All texels of the shape, row by row.
    void write(std::span<const std::byte> texels);
    void read(std::span<std::byte> texels) const;

private:
    friend class Framebuffer;  // attaches it

    const Device& device_;
    TexelFormat format_;
    std::string what_;
    TextureShape shape_;
    unsigned id_ = 0;
};

template <class T>
struct Texel;
template <>
struct Texel<std::uint32_t> {
    static constexpr TexelFormat format = TexelFormat::Uint;
};
template <>
struct Texel<std::array<std::uint32_t, 2>> {
    static constexpr TexelFormat format = TexelFormat::Uint2;
};
template <>
struct Texel<std::array<std::uint32_t, 4>> {
    static constexpr TexelFormat format = TexelFormat::Uint4;
};
template <>
struct Texel<std::array<float, 4>> {
    static constexpr TexelFormat format = TexelFormat::Float4;
};

/// A list of T, one a texel; texels behind its end are zero until a render pass writes them.
template <class T>
class Texture : public TextureStorage {
public:
    Texture(const Device& device, std::size_t size, std::string what)
        : TextureStorage(device, Texel<T>::format, size, std::move(what)), size_(size) {}
    Texture(const Device& device, std::span<const T> values, std::string what)
        : Texture(device, values.size(), std::move(what)) {
        const CurrentContext current = device.make_current();
        upload(values);
    }

    /// Replaces the whole list. Throws InvalidInput for another number of values.
    void upload(std::span<const T> values) {
        if (values.size() != size_)
            throw InvalidInput(std::to_string(values.size()) + " values for " + what() + ", which has " +
                               std::to_string(size_));
        std::vector<T> texels(shape().texels());
        std::copy(values.begin(), values.end(), texels.begin());
        write(std::as_bytes(std::span(texels)));
    }
    [[nodiscard]] std::vector<T> download() const {
        std::vector<T> texels(shape().texels());
        read(std::as_writable_bytes(std::span(texels)));
        texels.resize(size_);
        return texels;
    }

private:
    std::size_t size_;
};

}  // namespace tissuewarp::shaders
