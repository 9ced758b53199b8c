#include "imaging/detail/nifti_header.hpp"

#include "core/errors.hpp"
#include "imaging/detail/gzip.hpp"

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

/// Method 2 of nifti1.h: quaternion (b, c, d), offsets and pixdim, pixdim[0] = -1 turning the third axis.
Eigen::Matrix4d matrix_of_qform(const Fields& fields, const std::array<float, 8>& pixdim) {
    const double b = fields.at<float>(256), c = fields.at<float>(260), d = fields.at<float>(264);
    const double a = std::sqrt(std::max(0.0, 1.0 - (b * b + c * c + d * d)));
    Eigen::Matrix3d rotation;
    rotation << a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c), 2 * (b * c + a * d),
        a * a + c * c - b * b - d * d, 2 * (c * d - a * b), 2 * (b * d - a * c), 2 * (c * d + a * b),
        a * a + d * d - c * c - b * b;
    const double handedness = pixdim[0] < 0.0F ? -1.0 : 1.0;
    Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
    matrix.topLeftCorner<3, 3>() =
        rotation * Eigen::Vector3d(pixdim[1], pixdim[2], handedness * pixdim[3]).asDiagonal();
    for (int row = 0; row < 3; ++row) matrix(row, 3) = fields.at<float>(268 + 4 * static_cast<std::size_t>(row));
    return matrix;
}

}  // namespace

NiftiHeader read_nifti_header(const std::filesystem::path& path) {
    constexpr std::size_t header_bytes = 348;
    const std::string bytes = read_head(path, header_bytes);
    const auto refuse = [&](const std::string& cause) {
        return IoError("cannot read '" + path.string() + "': " + cause);
    };
    if (bytes.size() < header_bytes)
        throw refuse("it holds " + std::to_string(bytes.size()) +
                     " readable bytes, a NIfTI header has 348; copy the file again");
    const auto leading = Fields{bytes, false}.at<std::int32_t>(0);
    const auto leading_swapped = Fields{bytes, true}.at<std::int32_t>(0);
    if (leading == 540 || leading_swapped == 540) throw refuse("it is NIfTI-2; convert it to NIfTI-1 or NRRD");
    if ((leading != 348 && leading_swapped != 348) || bytes.compare(344, 4, std::string("n+1\0", 4)) != 0)
        throw refuse("its first bytes are no NIfTI-1 header (size 348, magic 'n+1'); give a single-file NIfTI-1 image");

    const Fields fields{bytes, leading != 348};
    NiftiHeader header;
    header.swapped = fields.swapped;
    for (std::size_t i = 0; i < 8; ++i) {
        header.dim[i] = fields.at<std::int16_t>(40 + 2 * i);
        header.pixdim[i] = fields.at<float>(76 + 4 * i);
    }
    header.intent_code = fields.at<std::int16_t>(68);
    header.datatype = fields.at<std::int16_t>(70);
    header.bits_per_voxel = fields.at<std::int16_t>(72);
    header.data_offset = fields.at<float>(108);
    header.slope = fields.at<float>(112);
    header.intercept = fields.at<float>(116);
    header.space_unit = fields.at<std::uint8_t>(123) & 7;
    header.qform_code = fields.at<std::int16_t>(252);
    header.sform_code = fields.at<std::int16_t>(254);
    header.qform = matrix_of_qform(fields, header.pixdim);
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 4; ++column)
            header.sform(row, column) =
                fields.at<float>(280 + 16 * static_cast<std::size_t>(row) + 4 * static_cast<std::size_t>(column));
    return header;
}

}  // namespace tissuewarp::imaging::detail
