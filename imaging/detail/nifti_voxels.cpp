#include "imaging/detail/nifti_voxels.hpp"

#include "core/errors.hpp"
#include "imaging/detail/wide_integers.hpp"

#include <tbb/parallel_for.h>
#include <zlib.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

/// Unpacks the bytes behind the header, to the end of the file so that the checksum is verified.
void read_payload(const fs::path& path, std::uint64_t offset, char* target, std::uint64_t count) {
    const std::unique_ptr<gzFile_s, int (*)(gzFile)> file(gzopen(path.c_str(), "rb"), gzclose);
    if (!file) throw IoError("cannot open '" + path.string() + "'; check the path and its rights");
    gzbuffer(file.get(), 1 << 18);
    const auto refuse = [&] {
        int code = Z_OK;
        const std::string cause = gzerror(file.get(), &code);
        throw IoError("'" + path.string() + "' is cut short or damaged" + (code == Z_OK ? "" : " (" + cause + ")") +
                      "; copy the file again");
    };
    if (gzseek(file.get(), static_cast<z_off_t>(offset), SEEK_SET) < 0) refuse();
    for (std::uint64_t done = 0; done < count;) {
        const auto piece = static_cast<unsigned>(std::min<std::uint64_t>(count - done, 1 << 26));
        const int got = gzread(file.get(), target + done, piece);
        if (got <= 0) refuse();
        done += static_cast<std::uint64_t>(got);
    }
    // A whole file ends here, or after a few bytes of padding.
    std::vector<char> rest(1 << 16);
    int got = 0;
    while ((got = gzread(file.get(), rest.data(), static_cast<unsigned>(rest.size()))) > 0) {
    }
    if (got < 0) refuse();
}

template <class T>
void swap_bytes(std::vector<T>& values) {
    for (T& value : values) {
        char* bytes = reinterpret_cast<char*>(&value);
        std::reverse(bytes, bytes + sizeof(T));
    }
}

/// Component planes (x of every voxel, then y, then z) into interleaved voxels of another type.
template <class From, class To, class Convert>
cv::Mat interleaved(const std::vector<From>& planes, const int* sizes, int channels, const Convert& convert) {
    cv::Mat voxels(3, sizes, CV_MAKETYPE(cv::DataType<To>::depth, channels));
    const std::size_t slice = static_cast<std::size_t>(sizes[1]) * static_cast<std::size_t>(sizes[2]);
    const std::size_t plane = slice * static_cast<std::size_t>(sizes[0]);
    const auto stride = static_cast<std::size_t>(channels);
    tbb::parallel_for(0, sizes[0], [&](int k) {
        To* target = voxels.ptr<To>(k);
        for (std::size_t c = 0; c < stride; ++c) {
            const From* source = planes.data() + c * plane + static_cast<std::size_t>(k) * slice;
            for (std::size_t i = 0; i < slice; ++i) target[i * stride + c] = convert(source[i]);
        }
    });
    return voxels;
}

struct Request {
    const fs::path& path;
    const NiftiHeader& header;
    std::array<int, 3> sizes;
    int channels;
};

/// T as stored, Scaled for v * slope + intercept.
template <class T, class Scaled>
cv::Mat read_as(const Request& request) {
    const NiftiHeader& header = request.header;
    const auto [nz, ny, nx] = request.sizes;
    std::vector<T> planes(static_cast<std::size_t>(nx) * static_cast<std::size_t>(ny) * static_cast<std::size_t>(nz) *
                          static_cast<std::size_t>(request.channels));
    read_payload(request.path, static_cast<std::uint64_t>(header.data_offset), reinterpret_cast<char*>(planes.data()),
                 planes.size() * sizeof(T));
    if (header.swapped) swap_bytes(planes);
    // Slope 0 means "no scaling" (nifti1.h); some writers leave NaN.
    const double slope = header.slope, intercept = header.intercept;
    const bool scaled =
        std::isfinite(slope) && std::isfinite(intercept) && slope != 0.0 && (slope != 1.0 || intercept != 0.0);
    if (scaled)
        return interleaved<T, Scaled>(planes, request.sizes.data(), request.channels, [&](T value) {
            return static_cast<Scaled>(slope * static_cast<double>(value) + intercept);
        });
    if constexpr (requires { cv::DataType<T>::depth; } && !std::is_same_v<T, std::uint32_t>) {
        return interleaved<T, T>(planes, request.sizes.data(), request.channels, [](T value) { return value; });
    } else if (all_fit_int32(planes)) {
        return interleaved<T, int>(planes, request.sizes.data(), request.channels,
                                   [](T v) { return static_cast<int>(v); });
    } else {
        return interleaved<T, double>(planes, request.sizes.data(), request.channels,
                                      [](T v) { return static_cast<double>(v); });
    }
}

}  // namespace

cv::Mat read_nifti_voxels(const fs::path& path, const NiftiHeader& header) {
    const bool vector = header.dim[0] >= 5 && header.dim[5] == 3;
    const Request request{path, header, {header.dim[3], header.dim[2], header.dim[1]}, vector ? 3 : 1};
    try {
        switch (header.datatype) {
            case 2:
                return read_as<std::uint8_t, float>(request);
            case 4:
                return read_as<std::int16_t, float>(request);
            case 8:
                return read_as<std::int32_t, double>(request);
            case 16:
                return read_as<float, float>(request);
            case 64:
                return read_as<double, double>(request);
            case 256:
                return read_as<std::int8_t, float>(request);
            case 512:
                return read_as<std::uint16_t, float>(request);
            case 768:
                return read_as<std::uint32_t, double>(request);
            case 1024:
                return read_as<std::int64_t, double>(request);
            case 1280:
                return read_as<std::uint64_t, double>(request);
            default:
                break;
        }
    } catch (const std::bad_alloc&) {
        throw IoError("cannot read '" + path.string() + "': it does not fit into memory");
    }
    throw InvalidInput("cannot use '" + path.string() + "': NIfTI data type " + std::to_string(header.datatype) +
                       " (colour, complex or long double); convert it to int16 or float32");
}

}  // namespace tissuewarp::imaging::detail
