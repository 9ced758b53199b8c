#include "apps/option_values.hpp"

#include "core/errors.hpp"
#include "registration/tissues.hpp"

#include <charconv>
#include <cmath>

namespace tissuewarp::apps {

std::string check_device(const std::string& value) {
    int index = 0;
    const char* end = value.data() + value.size();
    if (value == "auto" || value == "cpu" || value == "gpu") return {};
    if (value.starts_with("gpu:") && std::from_chars(value.data() + 4, end, index).ptr == end && value.size() > 4)
        return {};
    return "'" + value + "' is no device; give auto, cpu, gpu or gpu:<index> (see 'tissuewarp info --devices')";
}

std::map<int, double> label_lengths(const std::vector<std::string>& entries) {
    std::map<int, double> lengths;
    for (const std::string& entry : entries) {
        int label = 0;
        double length = 0;
        const char* end = entry.data() + entry.size();
        const auto first = std::from_chars(entry.data(), end, label);
        const bool equals = first.ptr != end && *first.ptr == '=';
        const auto second = equals ? std::from_chars(first.ptr + 1, end, length) : first;
        if (!equals || second.ptr != end || second.ec != std::errc() || label <= 0 || !(length > 0))
            throw InvalidInput("--label-edge-length '" + entry +
                               "' is not LABEL=MM with both above 0; write for instance 2=3.5");
        lengths[label] = length;
    }
    return lengths;
}

std::map<int, std::string> label_tissues(const std::vector<std::string>& entries) {
    std::map<int, std::string> tissues;
    for (const std::string& entry : entries) {
        int label = 0;
        const char* end = entry.data() + entry.size();
        const auto [stop, error] = std::from_chars(entry.data(), end, label);
        if (error != std::errc() || stop == end || *stop != '=' || label <= 0)
            throw InvalidInput("--label-tissue '" + entry + "' is not LABEL=TISSUE; write for instance 3=tumour");
        try {
            tissues[label] = registration::tissue_named(std::string(stop + 1, end)).name;
        } catch (const InvalidInput& error_of_name) {
            throw InvalidInput("--label-tissue '" + entry + "': " + error_of_name.what());
        }
    }
    return tissues;
}

std::optional<double> quantity(const std::string& option, const std::string& text,
                               const std::vector<std::pair<std::string, double>>& units) {
    if (text.empty()) return std::nullopt;
    double value = 0;
    const char* end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(text.data(), end, value);
    std::string unit(stop, end);
    unit.erase(0, unit.find_first_not_of(' '));
    if (unit.empty()) unit = units.front().first;
    for (const auto& [name, factor] : units)
        if (error == std::errc() && name == unit && value > 0 && std::isfinite(value)) return value * factor;
    throw InvalidInput(option + " '" + text + "' is no quantity above 0; write for instance 2" + units.front().first);
}

std::vector<int> label_list(const std::string& option, const std::vector<std::string>& entries) {
    std::vector<int> labels;
    for (const std::string& entry : entries) {
        int label = 0;
        const char* end = entry.data() + entry.size();
        const auto [stop, error] = std::from_chars(entry.data(), end, label);
        if (stop != end || error != std::errc() || label <= 0)
            throw InvalidInput(option + " '" + entry + "' is no label; give whole numbers above 0, for instance 3,4");
        labels.push_back(label);
    }
    return labels;
}

std::vector<std::array<int, 2>> label_pairs(const std::string& option, const std::vector<std::string>& entries) {
    const std::vector<int> labels = label_list(option, entries);
    if (labels.size() % 2 != 0)
        throw InvalidInput(option + " is given " + std::to_string(labels.size()) +
                           " labels; give pairs, for instance 1,2");
    std::vector<std::array<int, 2>> pairs;
    for (std::size_t n = 0; n < labels.size(); n += 2) pairs.push_back({labels[n], labels[n + 1]});
    return pairs;
}

}  // namespace tissuewarp::apps
