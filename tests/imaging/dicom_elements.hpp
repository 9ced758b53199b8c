#pragma once
/// DICOM files that tests write themselves, byte by byte, so that no library vouches for its own mistakes.

#include <zlib.h>
#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace tissuewarp::imaging::test {

/// Data elements in explicit little-endian transfer syntax (DICOM PS3.5, section 7.1.2).
class Elements {
public:
    void text(int group, int element, const char* representation, std::string value) {
        if (value.size() % 2) value += std::string(representation) == "UI" ? '\0' : ' ';
        head(group, element, representation);
        number<std::uint16_t>(static_cast<std::uint16_t>(value.size()));
        bytes_ += value;
    }
    void short_value(int group, int element, int value) {
        head(group, element, "US");
        number<std::uint16_t>(2);
        number<std::uint16_t>(static_cast<std::uint16_t>(value));
    }
    void long_value(int group, int element, std::uint32_t value) {
        head(group, element, "UL");
        number<std::uint16_t>(4);
        number(value);
    }
    void words(int group, int element, const std::vector<std::int16_t>& values) {
        head(group, element, "OW");
        number<std::uint16_t>(0);
        number(static_cast<std::uint32_t>(2 * values.size()));
        for (const std::int16_t value : values) number(value);
    }
    void bytes_value(int group, int element, const std::string& value) {
        head(group, element, "OB");
        number<std::uint16_t>(0);
        number(static_cast<std::uint32_t>(value.size() + value.size() % 2));
        bytes_ += value + std::string(value.size() % 2, '\0');
    }
    /// Packed pixels: an empty table of offsets and one fragment a frame.
    void fragments(const std::vector<std::string>& frames) {
        head(0x7fe0, 0x10, "OB");
        number<std::uint16_t>(0);
        number(0xffffffffU);
        item("");
        for (const std::string& frame : frames) item(frame + std::string(frame.size() % 2, '\0'));
        number(std::uint32_t{0xe0ddfffe});
        number(0U);
    }
    void sequence(int group, int element, const std::vector<Elements>& items) {
        Elements inner;
        for (const Elements& set : items) inner.item(set.bytes_);
        head(group, element, "SQ");
        number<std::uint16_t>(0);
        number(static_cast<std::uint32_t>(inner.bytes_.size()));
        bytes_ += inner.bytes_;
    }
    const std::string& bytes() const { return bytes_; }

private:
    template <class T>
    void number(T value) {
        bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
    }
    void item(const std::string& value) {
        number(std::uint32_t{0xe000fffe});
        number(static_cast<std::uint32_t>(value.size()));
        bytes_ += value;
    }
    void head(int group, int element, const char* representation) {
        number(static_cast<std::uint16_t>(group));
        number(static_cast<std::uint16_t>(element));
        bytes_ += representation;
    }
    std::string bytes_;
};

inline std::string decimals(const Eigen::VectorXd& values) {
    std::ostringstream text;
    text.precision(9);
    for (Eigen::Index i = 0; i < values.size(); ++i) text << (i ? "\\" : "") << values[i];
    return text.str();
}

constexpr const char* explicit_little_endian = "1.2.840.10008.1.2.1";
constexpr const char* deflated = "1.2.840.10008.1.2.1.99";
constexpr const char* run_lengths = "1.2.840.10008.1.2.5";

inline std::string deflated_bytes(std::string plain) {
    std::string packed(plain.size() + 1000, '\0');
    z_stream stream{};
    deflateInit2(&stream, 6, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY);
    stream.next_in = reinterpret_cast<Bytef*>(plain.data());
    stream.avail_in = static_cast<uInt>(plain.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    deflate(&stream, Z_FINISH);
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    return packed;
}

/// The elements behind a header of their own.
inline void write_dicom(const std::filesystem::path& path, const std::string& image_class, const std::string& instance,
                        const Elements& data, const char* transfer_syntax = explicit_little_endian) {
    Elements meta;
    meta.text(2, 2, "UI", image_class);
    meta.text(2, 3, "UI", instance);
    meta.text(2, 0x10, "UI", transfer_syntax);
    Elements length;
    length.long_value(2, 0, static_cast<std::uint32_t>(meta.bytes().size()));
    std::ofstream file(path, std::ios::binary);
    file << std::string(128, '\0') << "DICM" << length.bytes() << meta.bytes()
         << (std::string(transfer_syntax) == deflated ? deflated_bytes(data.bytes()) : data.bytes());
}

}  // namespace tissuewarp::imaging::test
