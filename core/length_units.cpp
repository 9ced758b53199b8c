#include "core/length_units.hpp"

#include <algorithm>
#include <cctype>
#include <map>
#include <string_view>

namespace tissuewarp {

std::optional<double> millimetres_per(const std::string& unit) {
    // The micro sign in UTF-8 (two code points look alike) and in Latin-1.
    static const std::map<std::string, double> known = {
        {"mm", 1.0},          {"millimeter", 1.0},  {"millimetre", 1.0}, {"cm", 10.0},        {"centimeter", 10.0},
        {"centimetre", 10.0}, {"m", 1000.0},        {"meter", 1000.0},   {"metre", 1000.0},   {"dm", 100.0},
        {"um", 1e-3},         {"\xc2\xb5m", 1e-3},  {"\xce\xbcm", 1e-3}, {"\xb5m", 1e-3},     {"micron", 1e-3},
        {"micrometer", 1e-3}, {"micrometre", 1e-3}, {"nm", 1e-6},        {"nanometer", 1e-6}, {"nanometre", 1e-6},
        {"in", 25.4},         {"inch", 25.4}};
    std::string name;
    for (const char c : unit)
        if (c != '"' && c != ' ') name += static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    for (const std::string_view plural : {"", "s", "es"}) {
        if (!plural.empty() && (name.size() <= 3 || !name.ends_with(plural))) continue;
        const auto found = known.find(name.substr(0, name.size() - plural.size()));
        if (found != known.end()) return found->second;
    }
    return std::nullopt;
}

}  // namespace tissuewarp
