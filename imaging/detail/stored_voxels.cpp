#include "imaging/detail/stored_voxels.hpp"
#include "imaging/detail/header_checks.hpp"

#include "core/errors.hpp"
#include "imaging/detail/gzip.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/wide_integers.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>
#include <fstream>
#include <new>
#include <sstream>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

std::uint64_t values_in(const StoredVoxels& stored) {
    std::uint64_t values = static_cast<std::uint64_t>(stored.channels);
    for (const int size : stored.size) values *= static_cast<std::uint64_t>(size);
    return values;
}

/// Bytes of one piece, unpacked.
std::uint64_t piece_bytes(const StoredVoxels& stored) {
    return values_in(stored) / stored.pieces.size() * bytes_of(stored.type);
}

std::uint64_t file_bytes(const fs::path& path, const fs::path& file) {
    std::error_code failure;
    const std::uint64_t bytes = fs::file_size(file, failure);
    if (failure)
        throw IoError("cannot read '" + path.string() + "': its voxels are to be in '" + shortened(file.string()) +
                      "', which cannot be read (" + failure.message() + "); put that file beside the header");
    return bytes;
}

/// What is promised beyond so many bytes is counted before memory is asked for: images rarely pack better, maps of few
/// labels do.
std::uint64_t rarely_packed(std::uint64_t packed) {
    return 10 * packed + (std::uint64_t{16} << 20);
}

/// Reads one piece after the other; with `target` null only their lengths are looked at.
class PieceReader {
public:
    PieceReader(const fs::path& path, const StoredVoxels& stored)
        : path_(path), stored_(stored), bytes_(piece_bytes(stored)) {}

    /// Refuses what cannot hold the promised bytes, before memory is asked for.
    void require_room() const {
        for (const Piece& piece : stored_.pieces) {
            const std::uint64_t on_disk = file_bytes(path_, piece.file);
            const std::uint64_t packed = on_disk > piece.offset ? on_disk - piece.offset : 0;
            if (stored_.packing == Packing::Raw) require_count(piece, packed);
            // Deflate cannot pack better than 1032 to 1; a number as text takes two characters.
            if (stored_.packing == Packing::Deflate && bytes_ / 1040 > packed) require_count(piece, packed);
            if (stored_.packing == Packing::Deflate && bytes_ > rarely_packed(packed)) read_piece(piece, nullptr);
            if (stored_.packing == Packing::Text && bytes_ / bytes_of(stored_.type) > packed / 2 + 1)
                require_count(piece, packed / 2 * bytes_of(stored_.type));
            if (stored_.packing == Packing::Hexadecimal && bytes_ > packed / 2) require_count(piece, packed / 2);
        }
    }
    void read(char* target) const {
        for (const Piece& piece : stored_.pieces) {
            read_piece(piece, target);
            if (target != nullptr) target += bytes_;
        }
    }

private:
    void require_count(const Piece& piece, std::uint64_t found) const {
        if (found == bytes_ || (found > bytes_ && stored_.surplus == Surplus::Allowed)) return;
        const std::string which = piece.file == path_ ? "" : " ('" + piece.file.string() + "')";
        if (found < bytes_ && stored_.packing == Packing::Raw && looks_packed(piece))
            throw IoError("cannot read '" + path_.string() + "'" + which +
                          ": its voxels are packed (gzip or zlib), and its header says that they are not; correct it "
                          "('encoding: gzip' of NRRD, 'CompressedData = True' of MetaImage)");
        if (found < bytes_)
            throw IoError("'" + path_.string() + "'" + which + " is cut short: its header promises " +
                          std::to_string(bytes_) + " bytes of voxels, " + std::to_string(found) +
                          " are there; copy the file again");
        throw IoError("'" + path_.string() + "'" + which + " does not fit its header: more data are there than the " +
                      std::to_string(bytes_) +
                      " bytes of voxels that it promises; correct size, type or length of header, or copy the file "
                      "again");
    }
    /// The first two bytes are those of gzip, or a multiple of 31 as those of zlib.
    [[nodiscard]] bool looks_packed(const Piece& piece) const {
        std::ifstream file = open(piece);
        const int first = file.get(), second = file.get();
        return (first == 0x1f && second == 0x8b) || (first == 0x78 && (256 * first + second) % 31 == 0);
    }
    void read_piece(const Piece& piece, char* target) const {
        switch (stored_.packing) {
            case Packing::Raw:
                return read_raw(piece, target);
            case Packing::Deflate:
                return require_count(piece, inflate(piece.file, piece.offset, {stored_.unpacked_skip, bytes_}, target));
            case Packing::Text:
                return read_text(piece, target);
            case Packing::Hexadecimal:
                return read_hexadecimal(piece, target);
        }
    }
    [[nodiscard]] std::ifstream open(const Piece& piece) const {
        std::ifstream file(piece.file, std::ios::binary);
        file.seekg(static_cast<std::streamoff>(piece.offset));
        if (!file)
            throw IoError("cannot read '" + piece.file.string() + "' from byte " + std::to_string(piece.offset) +
                          "; check the file and its rights");
        return file;
    }
    void read_raw(const Piece& piece, char* target) const {
        if (target == nullptr) return;  // `require_room` has counted
        std::ifstream file = open(piece);
        file.read(target, static_cast<std::streamsize>(bytes_));
        require_count(piece, static_cast<std::uint64_t>(file.gcount()));
    }
    void read_text(const Piece& piece, char* target) const;
    void read_hexadecimal(const Piece& piece, char* target) const {
        std::ifstream file = open(piece);
        std::uint64_t digits = 0;
        const auto value = [](int c) { return std::isdigit(c) ? c - '0' : std::tolower(c) - 'a' + 10; };
        for (int c = file.get(); c != EOF && digits < 2 * bytes_; c = file.get()) {
            if (!std::isxdigit(c)) continue;
            if (target != nullptr) {
                char& byte = target[digits / 2];
                byte = static_cast<char>(digits % 2 == 0 ? value(c) << 4 : static_cast<unsigned char>(byte) | value(c));
            }
            ++digits;
        }
        require_count(piece, digits / 2);
    }

    const fs::path& path_;
    const StoredVoxels& stored_;
    std::uint64_t bytes_;
};

/// Calls `use` with a value of the type.
template <class Use>
auto with_type(Scalar type, const Use& use) {
    switch (type) {
        case Scalar::Int8:
            return use(std::int8_t{});
        case Scalar::UInt8:
            return use(std::uint8_t{});
        case Scalar::Int16:
            return use(std::int16_t{});
        case Scalar::UInt16:
            return use(std::uint16_t{});
        case Scalar::Int32:
            return use(std::int32_t{});
        case Scalar::UInt32:
            return use(std::uint32_t{});
        case Scalar::Int64:
            return use(std::int64_t{});
        case Scalar::UInt64:
            return use(std::uint64_t{});
        case Scalar::Float32:
            return use(float{});
        default:
            return use(double{});
    }
}

void PieceReader::read_text(const Piece& piece, char* target) const {
    std::ifstream file = open(piece);
    const std::uint64_t count = bytes_ / bytes_of(stored_.type);
    with_type(stored_.type, [&](auto zero) {
        using T = decltype(zero);
        std::uint64_t found = 0;
        for (std::string word; found <= count && file >> word; ++found) {
            char* end = nullptr;
            const double number = std::strtod(word.c_str(), &end);
            if (*end != '\0')
                throw IoError("cannot read '" + path_.string() + "': '" + word.substr(0, 40) +
                              "' among its voxels is no number; the file is damaged");
            if (target == nullptr || found == count) continue;
            const auto value = static_cast<T>(number);
            std::memcpy(target + found * sizeof(T), &value, sizeof(T));
        }
        require_count(piece, found * sizeof(T));
    });
}

template <class T>
void swap_bytes(std::vector<T>& values) {
    for (T& value : values) {
        char* bytes = reinterpret_cast<char*>(&value);
        std::reverse(bytes, bytes + sizeof(T));
    }
}

cv::Mat empty_voxels(const StoredVoxels& stored, int depth) {
    const std::array<int, 3> sizes{stored.size[2], stored.size[1], stored.size[0]};
    return {3, sizes.data(), CV_MAKETYPE(depth, stored.channels)};
}

/// Values as stored, side by side or in planes, into voxels of another type.
template <class From, class To, class Convert>
cv::Mat converted(const std::vector<From>& values, const StoredVoxels& stored, const Convert& convert) {
    cv::Mat voxels = empty_voxels(stored, cv::DataType<To>::depth);
    const auto channels = static_cast<std::size_t>(stored.channels);
    const std::size_t slice = static_cast<std::size_t>(stored.size[0]) * static_cast<std::size_t>(stored.size[1]);
    const std::size_t plane = slice * static_cast<std::size_t>(stored.size[2]);
    const std::size_t next_voxel = stored.planar ? 1 : channels, next_component = stored.planar ? plane : 1;
    tbb::parallel_for(0, stored.size[2], [&](int k) {
        To* target = voxels.ptr<To>(k);
        const From* source = values.data() + static_cast<std::size_t>(k) * slice * next_voxel;
        for (std::size_t c = 0; c < channels; ++c)
            for (std::size_t i = 0; i < slice; ++i)
                target[i * channels + c] = convert(source[i * next_voxel + c * next_component]);
    });
    return voxels;
}

bool is_scaled(const StoredVoxels& stored) {
    return stored.slope != 1.0 || stored.intercept != 0.0;
}

template <class T>
constexpr bool opencv_has = requires {
    cv::DataType<T>::depth;
}
&&!std::is_same_v<T, std::uint32_t>;

template <class T>
cv::Mat read_as(const PieceReader& reader, const StoredVoxels& stored) {
    if constexpr (opencv_has<T>) {
        if (!stored.swapped && !is_scaled(stored) && (stored.channels == 1 || !stored.planar)) {
            cv::Mat voxels = empty_voxels(stored, cv::DataType<T>::depth);
            reader.read(reinterpret_cast<char*>(voxels.data));
            return voxels;
        }
    }
    std::vector<T> values(static_cast<std::size_t>(values_in(stored)));
    reader.read(reinterpret_cast<char*>(values.data()));
    if (stored.swapped && stored.packing != Packing::Text) swap_bytes(values);
    if (is_scaled(stored)) {
        using Scaled = std::conditional_t<sizeof(T) >= 4 && !std::is_same_v<T, float>, double, float>;
        return converted<T, Scaled>(values, stored, [&](T value) {
            return static_cast<Scaled>(stored.slope * static_cast<double>(value) + stored.intercept);
        });
    }
    if constexpr (opencv_has<T>) {
        return converted<T, T>(values, stored, [](T value) { return value; });
    } else if (all_fit_int32(values)) {
        return converted<T, int>(values, stored, [](T v) { return static_cast<int>(v); });
    } else {
        return converted<T, double>(values, stored, [](T v) { return static_cast<double>(v); });
    }
}

}  // namespace

std::size_t bytes_of(Scalar type) {
    return with_type(type, [](auto zero) { return sizeof(zero); });
}

cv::Mat read_stored_voxels(const fs::path& path, const StoredVoxels& stored) {
    const PieceReader reader(path, stored);
    reader.require_room();
    try {
        return with_type(stored.type, [&](auto zero) { return read_as<decltype(zero)>(reader, stored); });
    } catch (const std::bad_alloc&) {
        throw IoError("cannot read '" + path.string() + "': it does not fit into memory; give a smaller volume");
    }
}

void require_whole(const fs::path& path, const StoredVoxels& stored) {
    const PieceReader reader(path, stored);
    reader.require_room();
    reader.read(nullptr);
}

}  // namespace tissuewarp::imaging::detail
