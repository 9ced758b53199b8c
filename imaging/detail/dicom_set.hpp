#pragma once
/// The data elements of a DICOM file (PS3.5, section 7), bounds checked: a file that is cut short or damaged is an
/// error, where GDCM's assertions end the program.

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace tissuewarp::imaging::detail {

/// Group and element, (group << 16) + element.
using DicomTag = std::uint32_t;
inline constexpr DicomTag pixel_data = 0x7fe00010;

/// How elements are written; of a transfer syntax.
struct DicomEncoding {
    bool explicit_type = true;  ///< with a value representation
    bool big_endian = false;
};

/// Elements of one level. Views of the bytes of the file, which must outlive it.
class DicomSet {
public:
    DicomSet() = default;
    /// Throws std::out_of_range where an element does not end within the bytes; pixels may.
    DicomSet(std::string_view bytes, DicomEncoding encoding);

    [[nodiscard]] bool contains(DicomTag tag) const { return elements_.contains(tag); }
    /// The bytes of a value; empty when it is absent.
    [[nodiscard]] std::string_view bytes(DicomTag tag) const;
    /// Text without padding; "" when it is absent.
    [[nodiscard]] std::string text(DicomTag tag) const;
    /// A whole number of 16 bits.
    [[nodiscard]] int whole(DicomTag tag, int otherwise) const;
    /// Numbers that are written as text, `count` of them (0: any); nothing where there are not as many finite ones.
    [[nodiscard]] std::optional<std::vector<double>> numbers(DicomTag tag, std::size_t count) const;
    [[nodiscard]] std::optional<double> number(DicomTag tag) const;
    /// The items of a sequence; none when it is absent.
    [[nodiscard]] std::vector<DicomSet> items(DicomTag tag) const;
    /// The fragments of packed pixels, without the table of offsets; nothing where pixels are not packed.
    [[nodiscard]] std::optional<std::vector<std::string_view>> fragments(DicomTag tag) const;
    /// Bytes that the header of a value promises, of which `bytes` may hold fewer.
    [[nodiscard]] std::uint64_t promised(DicomTag tag) const;

private:
    struct Element {
        std::string_view value;
        std::uint64_t length = 0;  ///< as stated
        bool open = false;         ///< of undefined length
        bool implicit = false;     ///< a sequence of unknown type: its elements are implicit
    };
    std::map<DicomTag, Element> elements_;
    DicomEncoding encoding_;

    const Element* find(DicomTag tag) const;
};

/// A file's bytes and elements, which view them: it stays where it is.
struct DicomBytes {
    /// Throws IoError when the file cannot be read, is cut short before its pixels, or is damaged.
    explicit DicomBytes(const std::filesystem::path& path);
    DicomBytes(const DicomBytes&) = delete;
    DicomBytes& operator=(const DicomBytes&) = delete;

    std::string bytes;
    std::string transfer_syntax;
    bool big_endian = false;
    DicomSet set;
};

}  // namespace tissuewarp::imaging::detail
