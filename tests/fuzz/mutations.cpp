#include "tests/fuzz/mutations.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <cstring>
#include <limits>

namespace tissuewarp::fuzz {

namespace {

/// Below `count`, which is not 0.
std::size_t below(std::size_t count, Random& random) {
    return static_cast<std::size_t>(random() % count);
}

bool one_in(std::size_t count, Random& random) {
    return below(count, random) == 0;
}

template <class Container>
const auto& any_of(const Container& choices, Random& random) {
    return choices[below(std::size(choices), random)];
}

/// A place, mostly near the beginning, where headers are.
std::size_t place(const std::string& bytes, Random& random) {
    const std::size_t most = one_in(2, random) ? bytes.size() : std::min<std::size_t>(bytes.size(), 512);
    return most == 0 ? 0 : below(most, random);
}

struct Range {
    std::size_t first, count;
};

Range range(const std::string& bytes, Random& random) {
    const std::size_t first = place(bytes, random), rest = bytes.size() - first;
    const std::size_t most = one_in(3, random) ? rest : std::min<std::size_t>(rest, 32);
    return {first, most == 0 ? 0 : 1 + below(most, random)};
}

constexpr std::array<std::int64_t, 30> whole_numbers{0,
                                                     1,
                                                     2,
                                                     3,
                                                     4,
                                                     7,
                                                     16,
                                                     64,
                                                     127,
                                                     128,
                                                     255,
                                                     256,
                                                     1000,
                                                     1024,
                                                     32767,
                                                     32768,
                                                     65535,
                                                     65536,
                                                     1000000,
                                                     16777216,
                                                     2147483647,
                                                     2147483648,
                                                     4294967295,
                                                     4294967296,
                                                     std::numeric_limits<std::int64_t>::max(),
                                                     std::numeric_limits<std::int64_t>::min(),
                                                     -1,
                                                     -2,
                                                     -128,
                                                     -32768};

constexpr std::array<double, 16> real_numbers{0.0,
                                              -0.0,
                                              1.0,
                                              -1.0,
                                              0.5,
                                              1e-3,
                                              1e3,
                                              1e6,
                                              1e-38,
                                              3e38,
                                              1e308,
                                              -1e308,
                                              5e-324,
                                              std::numeric_limits<double>::quiet_NaN(),
                                              std::numeric_limits<double>::infinity(),
                                              -std::numeric_limits<double>::infinity()};

constexpr std::array<const char*, 32> number_texts{"0",
                                                   "-1",
                                                   "1",
                                                   "2",
                                                   "3",
                                                   "4",
                                                   "5",
                                                   "7",
                                                   "64",
                                                   "255",
                                                   "256",
                                                   "1000",
                                                   "65536",
                                                   "100000",
                                                   "2147483647",
                                                   "2147483648",
                                                   "-2147483648",
                                                   "4294967295",
                                                   "4294967296",
                                                   "9223372036854775807",
                                                   "9223372036854775808",
                                                   "18446744073709551615",
                                                   "nan",
                                                   "inf",
                                                   "-inf",
                                                   "1e308",
                                                   "-1e308",
                                                   "1e-320",
                                                   "1e999",
                                                   "0.5",
                                                   "1e6",
                                                   ""};

void put(std::string& bytes, std::size_t at, const void* value, int count, bool reversed) {
    std::array<char, 8> raw{};
    std::memcpy(raw.data(), value, static_cast<std::size_t>(count));
    if (reversed) std::reverse(raw.begin(), raw.begin() + count);
    if (at + static_cast<std::size_t>(count) <= bytes.size())
        std::copy_n(raw.begin(), count, bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

void put_number(std::string& bytes, const Field& field, bool reversed, Random& random) {
    const std::int64_t whole = any_of(whole_numbers, random);
    const double real = any_of(real_numbers, random);
    const auto narrow = static_cast<float>(std::clamp(real, -3.4e38, 3.4e38));
    if (field.real && field.bytes == 8) return put(bytes, field.offset, &real, 8, reversed);
    if (field.real && field.bytes == 4) return put(bytes, field.offset, &narrow, 4, reversed);
    put(bytes, field.offset, &whole, field.bytes, reversed);
}

/// Pieces between line ends, with them.
std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    for (std::size_t start = 0; start < text.size();) {
        const std::size_t end = std::min(text.find('\n', start), text.size() - 1);
        lines.push_back(text.substr(start, end + 1 - start));
        start = end + 1;
    }
    return lines;
}

struct Word {
    std::size_t first, count;
};

std::vector<Word> words_of(const std::string& text, bool numbers) {
    const auto belongs = [&](char c) {
        return numbers ? std::isdigit(static_cast<unsigned char>(c)) != 0 || c == '.' || c == '-'
                       : std::isgraph(static_cast<unsigned char>(c)) != 0;
    };
    std::vector<Word> words;
    const std::size_t most = std::min<std::size_t>(text.size(), 20000);
    for (std::size_t at = 0; at < most;) {
        std::size_t end = at;
        while (end < most && belongs(text[end])) ++end;
        if (end > at) words.push_back({at, end - at});
        at = end + 1;
    }
    return words;
}

// Each changes `bytes` once; `others` is another file of the format.

void flip_a_bit(std::string& bytes, Random& random) {
    if (!bytes.empty()) bytes[place(bytes, random)] ^= static_cast<char>(1U << below(8, random));
}

void set_a_byte(std::string& bytes, Random& random) {
    constexpr std::array<unsigned char, 12> values{0, 1, 0x20, 0x2d, 0x30, 0x39, 0x0a, 0x22, 0x7f, 0x80, 0xfe, 0xff};
    if (!bytes.empty()) bytes[place(bytes, random)] = static_cast<char>(any_of(values, random));
}

void cut_short(std::string& bytes, Random& random) {
    bytes.resize(bytes.empty() ? 0 : below(bytes.size(), random));
}

void drop_a_range(std::string& bytes, Random& random) {
    const Range piece = range(bytes, random);
    bytes.erase(piece.first, piece.count);
}

void repeat_a_range(std::string& bytes, Random& random) {
    const Range piece = range(bytes, random);
    const std::string copy = bytes.substr(piece.first, piece.count);
    const std::size_t times = one_in(20, random) ? std::min<std::size_t>(50000 / (copy.size() + 1), 20000) : 1;
    std::string more;
    for (std::size_t n = 0; n < times; ++n) more += copy;
    bytes.insert(piece.first, more);
}

void fill_a_range(std::string& bytes, Random& random) {
    const Range piece = range(bytes, random);
    bytes.replace(piece.first, piece.count, piece.count, one_in(2, random) ? '\0' : '\xff');
}

void insert_noise(std::string& bytes, Random& random) {
    std::string noise(1 + below(16, random), '\0');
    for (char& c : noise) c = static_cast<char>(random());
    bytes.insert(place(bytes, random), noise);
}

void put_any_number(std::string& bytes, Random& random) {
    constexpr std::array<int, 3> widths{2, 4, 8};
    const Field field{place(bytes, random), any_of(widths, random), one_in(3, random)};
    put_number(bytes, field, one_in(4, random), random);
}

void put_a_number_text(std::string& bytes, Random& random) {
    const std::vector<Word> words = words_of(bytes, true);
    if (words.empty()) return flip_a_bit(bytes, random);
    const Word& word = any_of(words, random);
    bytes.replace(word.first, word.count, any_of(number_texts, random));
}

void change_words(std::string& bytes, Random& random) {
    const std::vector<Word> words = words_of(bytes, false);
    if (words.empty()) return flip_a_bit(bytes, random);
    const Word &one = any_of(words, random), &two = any_of(words, random);
    const std::string other = bytes.substr(two.first, two.count);
    switch (below(3, random)) {
        case 0:
            bytes.erase(one.first, one.count);
            break;
        case 1:
            bytes.replace(one.first, one.count, other);
            break;
        default:
            bytes.insert(one.first, other + ' ');
    }
}

void change_lines(std::string& bytes, Random& random) {
    std::vector<std::string> lines = lines_of(bytes);
    if (lines.size() < 2) return flip_a_bit(bytes, random);
    const std::size_t one = below(lines.size(), random), two = below(lines.size(), random);
    const auto at = lines.begin() + static_cast<std::ptrdiff_t>(one);
    switch (below(3, random)) {
        case 0:
            std::swap(lines[one], lines[two]);
            break;
        case 1:
            lines.erase(at);
            break;
        default:
            lines.insert(at, std::string(lines[two]));
    }
    bytes.clear();
    for (const std::string& line : lines) bytes += line;
}

/// Brackets a hundred thousand deep, and other runs.
void repeat_a_character(std::string& bytes, Random& random) {
    constexpr std::array<char, 12> characters{'[', '{', '(', '"', '\n', ' ', ',', ';', '9', '<', '-', '\0'};
    bytes.insert(place(bytes, random), std::string(one_in(2, random) ? 300 : 100000, any_of(characters, random)));
}

void put_in_a_piece(std::string& bytes, const std::string& other, Random& random) {
    if (other.empty()) return;
    const Range from = range(other, random), to = range(bytes, random);
    bytes.replace(to.first, one_in(2, random) ? to.count : 0, other, from.first, from.count);
}

void change(std::string& bytes, const std::string& other, const std::vector<Field>& fields, Random& random) {
    if (!fields.empty() && one_in(2, random))
        return put_number(bytes, any_of(fields, random), one_in(8, random), random);
    using Change = void (*)(std::string&, Random&);
    constexpr std::array<Change, 16> changes{flip_a_bit,        set_a_byte,        cut_short,         drop_a_range,
                                             repeat_a_range,    fill_a_range,      insert_noise,      put_any_number,
                                             put_any_number,    put_a_number_text, put_a_number_text, put_a_number_text,
                                             put_a_number_text, change_words,      change_lines,      change_lines};
    if (one_in(40, random)) return repeat_a_character(bytes, random);
    if (one_in(12, random)) return put_in_a_piece(bytes, other, random);
    any_of(changes, random)(bytes, random);
}

void change_file(SeedFile& file, const SeedFile& other, const Format& format, Random& random) {
    if (file.packing != Packing::None && one_in(4, random)) file = {bytes_of(file), "", Packing::None};
    const bool in_head = file.body.empty() || (!file.head.empty() && !one_in(3, random));
    std::string& bytes = in_head ? file.head : file.body;
    const std::vector<Field> fields = format.fields ? format.fields(bytes) : std::vector<Field>{};
    for (std::size_t left = 1 + below(4, random); left > 0; --left)
        change(bytes, in_head ? other.head : other.body, fields, random);
}

/// A file that the header names is gone, is empty or is another.
void confuse_files(Seed& seed, Random& random) {
    auto at = std::next(seed.files.begin(), static_cast<std::ptrdiff_t>(below(seed.files.size(), random)));
    const auto other = std::next(seed.files.begin(), static_cast<std::ptrdiff_t>(below(seed.files.size(), random)));
    if (one_in(3, random) && at->first != seed.named)
        seed.files.erase(at);
    else
        at->second = one_in(3, random) ? SeedFile{} : SeedFile(other->second);
}

}  // namespace

Seed damaged(const Format& format, const std::vector<Seed>& seeds, Random& random) {
    Seed seed = any_of(seeds, random);
    const Seed& other = any_of(seeds, random);
    const auto any_file = [&](const Seed& from) {
        return std::next(from.files.begin(), static_cast<std::ptrdiff_t>(below(from.files.size(), random)))->first;
    };
    if (seed.files.size() > 1 && one_in(20, random)) confuse_files(seed, random);
    for (std::size_t left = one_in(5, random) ? 2 : 1; left > 0; --left)
        change_file(seed.files.at(any_file(seed)), other.files.at(any_file(other)), format, random);
    return seed;
}

}  // namespace tissuewarp::fuzz
