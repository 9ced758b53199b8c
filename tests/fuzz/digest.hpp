#pragma once
/// What a reader returned, as one number and a count: the same file must give the same twice.

#include <Eigen/Core>
#include <opencv2/core.hpp>

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>

namespace tissuewarp::fuzz {

class Digest {
public:
    void bytes(const void* data, std::size_t count) {
        const auto* byte = static_cast<const unsigned char*>(data);
        for (std::size_t i = 0; i < count; ++i) value_ = (value_ ^ byte[i]) * 1099511628211U;  // FNV-1a
    }
    template <class T>
    void number(const T& value) {
        static_assert(std::is_arithmetic_v<T>);
        bytes(&value, sizeof value);
    }
    void text(const std::string& text) { bytes(text.data(), text.size()); }

    /// Things of which each takes something in the file.
    template <class Derived>
    void matrix(const Eigen::MatrixBase<Derived>& matrix) {
        const auto values = matrix.eval();
        bytes(values.data(), sizeof(typename Derived::Scalar) * static_cast<std::size_t>(values.size()));
        items_ += static_cast<std::uint64_t>(values.size());
    }
    void voxels(const cv::Mat& voxels) {
        bytes(voxels.data, voxels.total() * voxels.elemSize());
        items_ += voxels.total() * static_cast<std::size_t>(voxels.channels());
    }

    [[nodiscard]] std::uint64_t value() const { return value_; }
    /// Numbers that must have been in the file.
    [[nodiscard]] std::uint64_t items() const { return items_; }

private:
    std::uint64_t value_ = 1469598103934665603U, items_ = 0;
};

}  // namespace tissuewarp::fuzz
