#include "imaging/detail/nifti_header.hpp"

#include "imaging/detail/gzip.hpp"
#include "imaging/detail/header_checks.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>

namespace tissuewarp::imaging::detail {

namespace {

/// Reads fields at the byte offsets of nifti1.h, turning the byte order where needed.
struct Fields {
    const std::string& bytes;
    bool swapped;

    template <class T>
    T at(std::size_t offset) const {
        std::array<char, sizeof(T)> raw;
        std::memcpy(raw.data(), bytes.data() + offset, sizeof(T));
        if (swapped) std::reverse(raw.begin(), raw.end());
        T value;
        std::memcpy(&value, raw.data(), sizeof(T));
        return value;
    }
};

/// Byte offsets of the fields of nifti1.h or nifti2.h.
struct Layout {
    std::size_t bytes, magic, dim, intent_p1, intent_code, intent_name, datatype, bitpix, pixdim, vox_offset, slope,
        intercept, units, qform_code, sform_code, quaternion, sform;
};
constexpr Layout nifti_1{348, 344, 40, 56, 68, 328, 70, 72, 76, 108, 112, 116, 123, 252, 254, 256, 280};
constexpr Layout nifti_2{540, 4, 16, 80, 504, 508, 12, 14, 104, 168, 176, 184, 500, 344, 348, 352, 400};

/// Method 2 of nifti1.h: quaternion (b, c, d), offsets and pixdim, pixdim[0] = -1 turning the third axis.
Eigen::Matrix4d matrix_of_qform(const std::array<double, 6>& quaternion, const std::array<double, 8>& pixdim) {
    double b = quaternion[0], c = quaternion[1], d = quaternion[2];
    double a = 1.0 - (b * b + c * c + d * d);
    if (a < 1e-7) {  // a half turn whose printed digits exceed unit length, as nifti1_io takes it
        const double length = std::sqrt(b * b + c * c + d * d);
        a = 0.0;
        b /= length, c /= length, d /= length;
    } else {
        a = std::sqrt(a);
    }
    Eigen::Matrix3d rotation;
    rotation << a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c), 2 * (b * c + a * d),
        a * a + c * c - b * b - d * d, 2 * (c * d - a * b), 2 * (b * d - a * c), 2 * (c * d + a * b),
        a * a + d * d - c * c - b * b;
    const double handedness = pixdim[0] < 0.0 ? -1.0 : 1.0;
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() =
        rotation * Eigen::Vector3d(pixdim[1], pixdim[2], handedness * pixdim[3]).asDiagonal();
    matrix.topRightCorner<3, 1>() = Eigen::Vector3d(quaternion[3], quaternion[4], quaternion[5]);
    return matrix;
}

/// The fields, of types I (codes) and N (sizes) and R (lengths).
template <class I, class N, class R>
NiftiHeader parse(const Fields& fields, const Layout& layout) {
    NiftiHeader header;
    header.swapped = fields.swapped;
    for (std::size_t i = 0; i < 8; ++i) {
        header.dim[i] = fields.at<N>(layout.dim + sizeof(N) * i);
        header.pixdim[i] = fields.at<R>(layout.pixdim + sizeof(R) * i);
    }
    header.intent_parameter = fields.at<R>(layout.intent_p1);
    header.intent_code = fields.at<I>(layout.intent_code);
    header.intent_name = std::string(fields.bytes.substr(layout.intent_name, 16).c_str());
    header.datatype = fields.at<std::int16_t>(layout.datatype);
    header.bits_per_voxel = fields.at<std::int16_t>(layout.bitpix);
    header.slope = fields.at<R>(layout.slope);
    header.intercept = fields.at<R>(layout.intercept);
    header.qform_code = fields.at<I>(layout.qform_code);
    header.sform_code = fields.at<I>(layout.sform_code);
    std::array<double, 6> quaternion{};
    for (std::size_t i = 0; i < 6; ++i) quaternion[i] = fields.at<R>(layout.quaternion + sizeof(R) * i);
    header.qform = matrix_of_qform(quaternion, header.pixdim);
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            header.sform(row, column) =
                fields.at<R>(layout.sform + sizeof(R) * static_cast<std::size_t>(4 * row + column));
    return header;
}

}  // namespace

NiftiHeader read_nifti_header(const std::filesystem::path& path) {
    const std::string bytes = read_head(path, nifti_2.bytes);
    if (bytes.size() < nifti_1.bytes)
        throw unreadable(path, "it holds " + std::to_string(bytes.size()) +
                                   " readable bytes, a NIfTI header has 348; copy the file again");
    const auto leading = Fields{bytes, false}.at<std::int32_t>(0);
    const auto leading_swapped = Fields{bytes, true}.at<std::int32_t>(0);
    const bool second = (leading == 540 || leading_swapped == 540) && bytes.size() >= nifti_2.bytes;
    const bool first = leading == 348 || leading_swapped == 348;
    const Layout& layout = second ? nifti_2 : nifti_1;
    const char version = second ? '2' : '1';
    const std::string magic = bytes.substr(layout.magic, 4);
    const bool single = magic == std::string("n+") + version + '\0';
    const bool pair = magic == std::string("ni") + version + '\0';
    if (first && !single && !pair && magic[0] != 'n')
        throw unusable(path,
                       "its header is of ANALYZE 7.5, which does not say where left and right are; convert it to "
                       "NIfTI with a program that knows where it came from");
    if ((!first && !second) || (!single && !pair))
        throw unreadable(path,
                         "its first bytes are no NIfTI header (size 348 and 'n+1', or 540 and 'n+2'); give a NIfTI "
                         "image");
    const Fields fields{bytes, leading != (second ? 540 : 348)};
    NiftiHeader header = second ? parse<std::int32_t, std::int64_t, double>(fields, layout)
                                : parse<std::int16_t, std::int16_t, float>(fields, layout);
    header.separate_voxels = pair;
    header.data_offset =
        second ? static_cast<double>(fields.at<std::int64_t>(layout.vox_offset)) : fields.at<float>(layout.vox_offset);
    const int units = second ? fields.at<std::int32_t>(layout.units) : fields.at<std::uint8_t>(layout.units);
    header.space_unit = units & 7;
    return header;
}

}  // namespace tissuewarp::imaging::detail
