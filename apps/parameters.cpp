#include "apps/parameters.hpp"

#include "core/atomic_file.hpp"

#include <algorithm>
#include <numeric>

namespace tissuewarp::apps {

namespace {

std::string quoted(const std::string& value) {
    std::string text = "\"";
    for (const char c : value) {
        if (c == '"' || c == '\\') text += '\\';
        text += c;
    }
    return text + '"';
}

/// TOML's floats need digits on both sides of the point; its integers and exponents read as C++ writes them.
std::string toml_number(const std::string& value) {
    const auto point = value.find('.');
    if (point == std::string::npos) return value;
    std::string text = value;
    if (point == 0) text.insert(0, "0");
    if (text.back() == '.') text += '0';
    return text;
}

std::string toml_value(const Parameter& parameter) {
    switch (parameter.kind) {
        case Parameter::Kind::Switch:
            return parameter.values.empty() ? "false" : parameter.values.front();
        case Parameter::Kind::Number:
            return toml_number(parameter.values.front());
        case Parameter::Kind::Text:
            return quoted(parameter.values.front());
        case Parameter::Kind::TextList:
            break;
    }
    std::string text = "[";
    for (const std::string& value : parameter.values) text += (text.size() > 1 ? ", " : "") + quoted(value);
    return text + "]";
}

/// Levenshtein's distance, one row at a time.
std::size_t edit_distance(const std::string& a, const std::string& b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), 0);
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = row[0];
        row[0] = i;
        for (std::size_t j = 1; j <= b.size(); ++j) {
            const std::size_t replaced = diagonal + (a[i - 1] != b[j - 1]);
            diagonal = row[j];
            row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
        }
    }
    return row.back();
}

}  // namespace

std::string to_toml(const std::vector<Parameter>& parameters) {
    std::string text = "# Parameters of `tissuewarp register`; every key is a long option. Read them with --config.\n";
    for (const Parameter& parameter : parameters) text += parameter.name + " = " + toml_value(parameter) + "\n";
    return text;
}

void save_parameters(const std::vector<Parameter>& parameters, const std::filesystem::path& path) {
    write_file(to_toml(parameters), path);
}

std::string nearest_name(const std::string& word, const std::vector<std::string>& names) {
    std::string best;
    std::size_t distance = std::max<std::size_t>(2, word.size() / 2) + 1;
    for (const std::string& name : names) {
        const std::size_t candidate = edit_distance(word, name);
        if (candidate < distance) {
            distance = candidate;
            best = name;
        }
    }
    return best;
}

}  // namespace tissuewarp::apps
