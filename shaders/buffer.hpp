#pragma once
/// Memory on the device, owned. Contents move only when asked.

#include "core/errors.hpp"
#include "shaders/device.hpp"

#include <cstddef>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

namespace tissuewarp::shaders {

/// Bytes on a device. Members need the device's context current, except construction and destruction, which make it so.
class StorageBuffer {
public:
    /// Contents are zero. Throws GpuUnavailable when `bytes` exceeds the device's storage block or memory; `what` names
    /// the contents in that message.
    StorageBuffer(const Device& device, std::size_t bytes, std::string what);
    ~StorageBuffer();
    StorageBuffer(StorageBuffer&& other) noexcept;
    StorageBuffer(const StorageBuffer&) = delete;
    StorageBuffer& operator=(const StorageBuffer&) = delete;
    StorageBuffer& operator=(StorageBuffer&&) = delete;

    void write(std::size_t offset, std::span<const std::byte> bytes);
    void read(std::size_t offset, std::span<std::byte> bytes) const;
    void clear();
    /// Copies the first `bytes` of `source`.
    void copy_from(const StorageBuffer& source, std::size_t bytes);
    /// Makes this the storage block of that binding.
    void bind(int binding) const;

    [[nodiscard]] std::size_t bytes() const { return bytes_; }
    [[nodiscard]] const std::string& what() const { return what_; }

private:
    friend class Readback;
    friend class Upload;
    void require_range(std::size_t offset, std::size_t bytes) const;

    const Device* device_;
    std::size_t bytes_;
    std::string what_;
    unsigned id_ = 0;
};

/// An array of T on a device. T must have the layout that std430 gives its GLSL counterpart.
template <class T>
class Buffer : public StorageBuffer {
    static_assert(std::is_trivially_copyable_v<T>);

public:
    Buffer(const Device& device, std::size_t size, std::string what)
        : StorageBuffer(device, size * sizeof(T), std::move(what)), size_(size) {}
    Buffer(const Device& device, std::span<const T> values, std::string what)
        : Buffer(device, values.size(), std::move(what)) {
        const CurrentContext current = device.make_current();
        upload(values);
    }
    /// Of values that lie in memory under another type, four voxels a word or floats that the device takes as bits.
    Buffer(const Device& device, std::span<const std::byte> bytes, std::string what)
        requires(!std::is_same_v<T, std::byte>)
        : StorageBuffer(device, bytes.size(), std::move(what)), size_(bytes.size() / sizeof(T)) {
        const CurrentContext current = device.make_current();
        write(0, bytes);
    }

    [[nodiscard]] std::size_t size() const { return size_; }
    void upload(std::span<const T> values, std::size_t first = 0) { write(first * sizeof(T), std::as_bytes(values)); }
    void download(std::span<T> values, std::size_t first = 0) const {
        read(first * sizeof(T), std::as_writable_bytes(values));
    }
    [[nodiscard]] std::vector<T> download() const {
        std::vector<T> values(size_);
        download(values);
        return values;
    }

private:
    std::size_t size_;
};

}  // namespace tissuewarp::shaders
