#include "imaging/detail/dicom_set.hpp"

#include "imaging/detail/dicom_bits.hpp"
#include "imaging/detail/header_checks.hpp"
#include "imaging/detail/text_headers.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>
#include <stdexcept>

namespace tissuewarp::imaging::detail {
namespace fs = std::filesystem;

namespace {

constexpr DicomTag item_tag = 0xfffee000, item_end = 0xfffee00d, sequence_end = 0xfffee0dd;
constexpr std::uint32_t undefined_length = 0xffffffff;
constexpr int deepest = 32;  // sequences within sequences: more is a damaged file

/// Reads elements one after the other.
class Cursor {
public:
    Cursor(std::string_view bytes, DicomEncoding encoding) : bytes_(bytes), encoding_(encoding) {}

    struct Header {
        DicomTag tag = 0;
        std::string_view type;  ///< value representation, empty when implicit
        std::uint32_t length = 0;
    };
    [[nodiscard]] bool at_end() const { return at_ >= bytes_.size(); }
    [[nodiscard]] std::size_t at() const { return at_; }

    Header header() {
        Header header;
        const std::uint32_t group = whole(2);
        header.tag = group << 16 | whole(2);
        if (group == 0xfffe || !encoding_.explicit_type) {
            header.length = whole(4);
            return header;
        }
        header.type = take(2);
        static const std::set<std::string_view> with_long_length = {"OB", "OD", "OF", "OL", "OV", "OW", "SQ",
                                                                    "SV", "UC", "UN", "UR", "UT", "UV"};
        const bool is_long = with_long_length.contains(header.type);
        if (is_long) take(2);
        header.length = whole(is_long ? 4 : 2);
        return header;
    }
    std::string_view take(std::uint64_t count) {
        if (count > bytes_.size() - at_) throw std::out_of_range("an element ends behind the file");
        const std::string_view taken = bytes_.substr(at_, count);
        at_ += count;
        return taken;
    }
    [[nodiscard]] std::uint64_t left() const { return bytes_.size() - at_; }

    /// Passes over the items of a sequence of undefined length, or over elements up to the end of an item.
    void skip_sequence(int depth) {
        if (depth > deepest) throw std::out_of_range("sequences lie too deep");
        for (;;) {
            const Header next = header();
            if (next.tag == sequence_end) return;
            if (next.tag != item_tag) throw std::out_of_range("a sequence holds no item");
            next.length == undefined_length ? skip_item(depth + 1) : void(take(next.length));
        }
    }
    void skip_item(int depth) {
        if (depth > deepest) throw std::out_of_range("sequences lie too deep");
        for (;;) {
            const Header next = header();
            if (next.tag == item_end) return;
            next.length == undefined_length ? skip_open(next, depth + 1) : void(take(next.length));
        }
    }
    /// Behind the header of an element of undefined length. Those of unknown type hold implicit elements.
    void skip_open(const Header& element, int depth) {
        const DicomEncoding own = encoding_;
        if (element.type == "UN") encoding_ = {false, false};
        skip_sequence(depth);
        encoding_ = own;
    }

private:
    std::string_view bytes_;
    DicomEncoding encoding_;
    std::size_t at_ = 0;

    std::uint32_t whole(int count) {
        const std::string_view raw = take(static_cast<std::uint64_t>(count));
        std::uint32_t value = 0;
        for (int i = 0; i < count; ++i) {
            const auto byte =
                static_cast<unsigned char>(raw[static_cast<std::size_t>(encoding_.big_endian ? i : count - 1 - i)]);
            value = value << 8 | byte;
        }
        return value;
    }
};

/// Elements behind group 0002 in the encoding that the transfer syntax names.
DicomEncoding encoding_of(const std::string& syntax) {
    if (syntax == "1.2.840.10008.1.2") return {false, false};
    if (syntax == "1.2.840.10008.1.2.2") return {true, true};
    return {true, false};
}

/// Files without a header of their own: explicit ones have two capitals behind the first tag.
DicomEncoding guessed(std::string_view data) {
    if (data.size() < 8) return {false, false};
    const auto capital = [&](std::size_t i) { return data[i] >= 'A' && data[i] <= 'Z'; };
    return {capital(4) && capital(5), data[0] == 0 && data[1] != 0};
}

}  // namespace

DicomSet::DicomSet(std::string_view bytes, DicomEncoding encoding) : encoding_(encoding) {
    Cursor cursor(bytes, encoding);
    while (!cursor.at_end()) {
        const Cursor::Header header = cursor.header();
        if (header.tag == item_end || header.tag == sequence_end) return;
        Element element;
        element.length = header.length;
        element.open = header.length == undefined_length;
        element.implicit = header.type == "UN";
        const std::size_t begin = cursor.at();
        if (!element.open) {
            // Pixels that are cut short are told from their length where they are read.
            element.value = cursor.take(header.tag == pixel_data ? std::min<std::uint64_t>(header.length, cursor.left())
                                                                 : header.length);
        } else if (header.tag == pixel_data) {
            element.value = cursor.take(cursor.left());
        } else {
            cursor.skip_open(header, 0);
            element.value = bytes.substr(begin, cursor.at() - begin);
        }
        elements_[header.tag] = element;
    }
}

const DicomSet::Element* DicomSet::find(DicomTag tag) const {
    const auto found = elements_.find(tag);
    return found == elements_.end() ? nullptr : &found->second;
}

std::string_view DicomSet::bytes(DicomTag tag) const {
    const Element* element = find(tag);
    return element == nullptr ? std::string_view() : element->value;
}

std::uint64_t DicomSet::promised(DicomTag tag) const {
    const Element* element = find(tag);
    return element == nullptr ? 0 : element->length;
}

std::string DicomSet::text(DicomTag tag) const {
    std::string text(bytes(tag));
    text.erase(std::remove(text.begin(), text.end(), '\0'), text.end());
    return trimmed(text);
}

int DicomSet::whole(DicomTag tag, int otherwise) const {
    const std::string_view value = bytes(tag);
    if (value.size() < 2) return otherwise;
    const auto first = static_cast<unsigned char>(value[0]), second = static_cast<unsigned char>(value[1]);
    return encoding_.big_endian ? first << 8 | second : second << 8 | first;
}

std::optional<std::vector<double>> DicomSet::numbers(DicomTag tag, std::size_t count) const {
    std::string written = text(tag);
    std::replace(written.begin(), written.end(), '\\', ' ');
    std::vector<double> values = numbers_in(written);
    if (values.empty() || (count != 0 && values.size() != count)) return std::nullopt;
    if (std::any_of(values.begin(), values.end(), [](double n) { return !std::isfinite(n); })) return std::nullopt;
    return values;
}

std::optional<double> DicomSet::number(DicomTag tag) const {
    const auto found = numbers(tag, 1);
    return found ? std::optional((*found)[0]) : std::nullopt;
}

std::vector<DicomSet> DicomSet::items(DicomTag tag) const {
    std::vector<DicomSet> sets;
    const Element* element = find(tag);
    if (element == nullptr) return sets;
    const DicomEncoding inner = element->implicit ? DicomEncoding{false, false} : encoding_;
    Cursor cursor(element->value, inner);
    while (!cursor.at_end()) {
        const Cursor::Header header = cursor.header();
        if (header.tag != item_tag) break;
        const std::size_t begin = cursor.at();
        if (header.length == undefined_length)
            cursor.skip_item(0);
        else
            cursor.take(header.length);
        sets.emplace_back(element->value.substr(begin, cursor.at() - begin), inner);
    }
    return sets;
}

std::optional<std::vector<std::string_view>> DicomSet::fragments(DicomTag tag) const {
    const Element* element = find(tag);
    if (element == nullptr || !element->open) return std::nullopt;
    std::vector<std::string_view> result;
    Cursor cursor(element->value, encoding_);
    for (bool table = true;; table = false) {
        const Cursor::Header header = cursor.header();
        if (header.tag != item_tag) break;
        const std::string_view fragment = cursor.take(header.length);
        if (!table) result.push_back(fragment);
    }
    return result;
}

DicomBytes::DicomBytes(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    if (!stream) throw IoError("cannot open '" + path.string() + "'; check the path and its rights");
    std::error_code failure;
    bytes.resize(fs::file_size(path, failure));
    stream.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (failure || static_cast<std::size_t>(stream.gcount()) != bytes.size())
        throw IoError("cannot read '" + path.string() + "'; check the file and its rights");
    try {
        std::string_view data = bytes;
        if (data.size() >= 132 && data.substr(128, 4) == "DICM") data.remove_prefix(132);
        Cursor meta(data, {true, false});
        while (meta.left() >= 8 && data.substr(meta.at(), 2) == std::string_view("\2\0", 2)) {
            const Cursor::Header header = meta.header();
            const std::string_view value = meta.take(header.length);
            if (header.tag == 0x00020010) transfer_syntax = trimmed(std::string(value).c_str());
        }
        data.remove_prefix(meta.at());
        if (transfer_syntax == "1.2.840.10008.1.2.1.99") {
            bytes = unpack_deflated(data);
            data = bytes;
        }
        const DicomEncoding encoding = transfer_syntax.empty() ? guessed(data) : encoding_of(transfer_syntax);
        big_endian = encoding.big_endian;
        set = DicomSet(data, encoding);
    } catch (const std::out_of_range&) {
        throw IoError("cannot read '" + path.string() + "' as DICOM: it is cut short or damaged; copy the file again");
    }
}

}  // namespace tissuewarp::imaging::detail
