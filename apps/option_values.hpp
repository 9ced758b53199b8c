#pragma once
/// What options of the command line say beyond numbers and text. Each throws InvalidInput with the option, its value
/// and an example where that is no such thing.

#include <array>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace tissuewarp::apps {

/// Empty for "auto", "cpu", "gpu" and "gpu:<index>", otherwise what is wrong.
std::string check_device(const std::string& value);
/// Of --label-edge-length: "2=3.5" each, mm.
std::map<int, double> label_lengths(const std::vector<std::string>& entries);
/// Of --label-tissue: "3=tumour" each, names of registration/tissues.hpp.
std::map<int, std::string> label_tissues(const std::vector<std::string>& entries);
/// "0.5mm", "0.5 mm" or "0.5", in the first of the units (name, factor); nothing where there is no text.
std::optional<double> quantity(const std::string& option, const std::string& text,
                               const std::vector<std::pair<std::string, double>>& units);
/// Whole numbers above 0.
std::vector<int> label_list(const std::string& option, const std::vector<std::string>& entries);
/// The same, two and two.
std::vector<std::array<int, 2>> label_pairs(const std::string& option, const std::vector<std::string>& entries);

}  // namespace tissuewarp::apps
