#include "core/free_text.hpp"

#include "core/length_units.hpp"
#include "core/text_table.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <map>
#include <vector>

namespace tissuewarp {

namespace {

/// A run of letters and digits, and whether it is part of a longer name such as "brain_ras.nii".
struct Word {
    std::string text;
    bool joined;
};

bool is_letter(char c) {
    const auto byte = static_cast<unsigned char>(c);
    return std::isalnum(byte) != 0 || byte >= 0x80;  // "µm"
}

std::vector<Word> words_in(std::string_view text) {
    const auto at = [&](std::size_t n) { return n < text.size() ? text[n] : ' '; };
    std::vector<Word> words;
    for (std::size_t start = 0; start < text.size(); ++start) {
        if (!is_letter(text[start])) continue;
        std::size_t end = start;
        while (end < text.size() && is_letter(text[end])) ++end;
        const char before = start > 0 ? text[start - 1] : ' ', after = at(end);
        const bool joined = std::string_view("_./\\").find(before) != std::string_view::npos || after == '_' ||
                            (after == '.' && is_letter(at(end + 1)));
        words.push_back({std::string(text.substr(start, end - start)), joined});
        start = end;
    }
    return words;
}

std::string upper_case(std::string text) {
    for (char& c : text) c = static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
    return text;
}

/// One letter of each axis.
bool names_three_axes(const std::string& letters) {
    if (letters.size() != 3) return false;
    const std::array<std::string_view, 3> axes{"LR", "PA", "SI"};
    return std::all_of(axes.begin(), axes.end(), [&](std::string_view axis) {
        return std::count_if(letters.begin(), letters.end(),
                             [&](char c) { return axis.find(c) != std::string_view::npos; }) == 1;
    });
}

bool speaks_of_frames(const std::vector<Word>& words) {
    static const std::set<std::string> keys{"space", "coordinate",      "coordinates", "system", "coordinatesystem",
                                            "frame", "coordinateframe", "orientation"};
    return std::any_of(words.begin(), words.end(),
                       [](const Word& word) { return keys.contains(lower_case(word.text)); });
}

/// "right", "anterior", "superior" from here on as "RAS"; empty where there are not three of them.
std::string directions_from(const std::vector<Word>& words, std::size_t first) {
    static const std::map<std::string, char> letters{{"left", 'L'},      {"right", 'R'},    {"anterior", 'A'},
                                                     {"posterior", 'P'}, {"superior", 'S'}, {"inferior", 'I'}};
    std::string found;
    for (std::size_t w = first; w < std::min(first + 3, words.size()); ++w)
        if (const auto letter = letters.find(lower_case(words[w].text)); letter != letters.end())
            found += letter->second;
    return names_three_axes(found) ? found : "";
}

std::set<std::string> frames_of(const std::vector<Word>& words) {
    const bool stated = speaks_of_frames(words);
    std::set<std::string> frames;
    for (std::size_t w = 0; w < words.size(); ++w) {
        const std::string& text = words[w].text;
        const std::string letters = upper_case(text);
        const bool usual = letters == "RAS" || letters == "LPS";
        if ((usual && text == letters) || (stated && !words[w].joined && names_three_axes(letters)))
            frames.insert(letters);
        if (const std::string directions = directions_from(words, w); !directions.empty()) frames.insert(directions);
    }
    return frames;
}

}  // namespace

std::set<std::string> frames_in(std::string_view text) {
    return frames_of(words_in(text));
}

std::set<std::string> frames_stated_in(std::string_view text) {
    const std::vector<Word> words = words_in(text);
    return speaks_of_frames(words) ? frames_of(words) : std::set<std::string>{};
}

std::string foreign_unit_in(std::string_view text) {
    static const std::set<std::string> passed{"of", "length", "is", "are", "in"};
    const std::vector<Word> words = words_in(text);
    for (std::size_t w = 0; w < words.size(); ++w) {
        const std::string key = lower_case(words[w].text);
        if (key != "unit" && key != "units" && key != "lengthunit" && key != "lengthunits") continue;
        std::size_t next = w + 1;
        while (next < words.size() && passed.contains(lower_case(words[next].text))) ++next;
        if (next == words.size()) return "";
        const auto millimetres = millimetres_per(words[next].text);
        if (millimetres && *millimetres != 1) return words[next].text;
    }
    return "";
}

}  // namespace tissuewarp
