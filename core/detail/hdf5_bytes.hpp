#pragma once
/// A file mapped into memory, read within its bounds.

#include "core/errors.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

namespace tissuewarp::detail {

/// Every access outside throws IoError with the file's name.
class Hdf5Bytes {
public:
    explicit Hdf5Bytes(const std::filesystem::path& path) : path_(path) {
        const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
        std::error_code failure;
        size_ = std::filesystem::file_size(path, failure);
        if (file >= 0 && !failure && size_ > 0) data_ = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, file, 0);
        if (file >= 0) ::close(file);
        if (data_ == MAP_FAILED) throw IoError("cannot read '" + path.string() + "'; check the file and its rights");
    }
    ~Hdf5Bytes() { ::munmap(data_, size_); }
    Hdf5Bytes(const Hdf5Bytes&) = delete;
    Hdf5Bytes& operator=(const Hdf5Bytes&) = delete;

    [[nodiscard]] std::uint64_t size() const { return size_; }

    /// Little-endian.
    template <class T>
    [[nodiscard]] T at(std::uint64_t place) const {
        require(place, sizeof(T));
        T value;
        std::memcpy(&value, static_cast<const char*>(data_) + place, sizeof(T));
        return value;
    }
    /// Of 1, 2, 4 or 8 bytes.
    [[nodiscard]] std::uint64_t whole(std::uint64_t place, std::uint64_t bytes) const {
        require(place, bytes);
        std::uint64_t value = 0;
        std::memcpy(&value, static_cast<const char*>(data_) + place, bytes);
        return value;
    }
    [[nodiscard]] bool begins(std::uint64_t place, std::string_view signature) const {
        require(place, signature.size());
        return std::memcmp(static_cast<const char*>(data_) + place, signature.data(), signature.size()) == 0;
    }
    /// Whether a text that begins here ends before `end`.
    [[nodiscard]] bool holds_text(std::uint64_t place, std::uint64_t end) const {
        require(place, 0);
        return place < end && std::memchr(static_cast<const char*>(data_) + place, 0, end - place) != nullptr;
    }

    void require(std::uint64_t place, std::uint64_t bytes) const {
        if (place > size_ || bytes > size_ - place) fail("a part of it lies behind its end");
    }
    [[noreturn]] void fail(const std::string& what) const {
        throw IoError("'" + path_.string() + "' is damaged: " + what + "; copy the file again, or write it anew");
    }
    /// Of files that may be in order.
    [[noreturn]] void refuse(const std::string& what) const {
        throw IoError("'" + path_.string() + "' is written in a form of HDF5 that is not read here: " + what +
                      "; write it anew for earlier versions, a transform as text (.tfm)");
    }

private:
    std::filesystem::path path_;
    std::uint64_t size_ = 0;
    void* data_ = MAP_FAILED;
};

}  // namespace tissuewarp::detail
