#include "apps/toml_reader.hpp"

#include "apps/parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace tissuewarp::apps {

namespace {

std::string with_unit(double value, const std::string& unit) {
    return fmt::format("{}{}{}", value, unit.empty() ? "" : " ", unit);
}

std::string in_words(const Range& range) {
    if (range.least <= std::numeric_limits<double>::lowest())
        return range.most >= std::numeric_limits<double>::max() ? "a finite number"
                                                                : "at most " + with_unit(range.most, range.unit);
    if (range.most >= std::numeric_limits<double>::max()) return "at least " + with_unit(range.least, range.unit);
    return fmt::format("{} to {}", range.least, with_unit(range.most, range.unit));
}

/// The name that lacks nothing but its unit, or the nearest in letters.
std::string meant(const std::string& word, const std::vector<std::string>& names) {
    for (const std::string& name : names)
        if (name.starts_with(word + "_")) return name;
    return nearest_name(word, names);
}

}  // namespace

TomlReader::TomlReader(const toml::table& table, const std::filesystem::path& path, std::string name)
    : table_(table), path_(path), name_(std::move(name)) {}

const toml::node* TomlReader::node(const std::string& key) {
    asked_.insert(key);
    return table_.get(key);
}

std::string TomlReader::place(const std::string& key) const {
    const toml::node* found = table_.get(key);
    return toml_place(path_, found ? *found : static_cast<const toml::node&>(table_));
}

void TomlReader::refuse(const std::string& key, const std::string& message) const {
    throw InvalidInput(place(key) + ": " + message);
}

double TomlReader::number_of(const toml::node& node, const std::string& key, const Range& range) const {
    const std::optional<double> value = node.is_number() ? node.value<double>() : std::nullopt;
    const std::string unit = range.unit.empty() ? "" : " (" + range.unit + ")";
    if (!value) throw InvalidInput(number_place(node) + ": '" + key + "' must be a number" + unit);
    if (!std::isfinite(*value) || *value < range.least || *value > range.most)
        throw InvalidInput(number_place(node) + ": '" + key + "' is " + with_unit(*value, range.unit) + "; give " +
                           in_words(range));
    return *value;
}

std::optional<double> TomlReader::number(const std::string& key, const Range& range) {
    const toml::node* found = node(key);
    return found ? std::optional(number_of(*found, key, range)) : std::nullopt;
}

double TomlReader::required_number(const std::string& key, const Range& range) {
    if (const auto value = number(key, range)) return *value;
    throw InvalidInput(place() + ": " + name_ + " lacks '" + key + "'" +
                       (range.unit.empty() ? "" : " (" + range.unit + ")"));
}

std::optional<int> TomlReader::whole(const std::string& key, int least, int most) {
    const toml::node* found = node(key);
    if (!found) return std::nullopt;
    const auto value = found->is_integer() ? found->value<std::int64_t>() : std::nullopt;
    if (!value || *value < least || *value > most)
        refuse(key, fmt::format("'{}' must be a whole number from {} to {}", key, least, most));
    return static_cast<int>(*value);
}

std::optional<bool> TomlReader::flag(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return std::nullopt;
    if (!found->is_boolean()) refuse(key, "'" + key + "' must be true or false");
    return found->value<bool>();
}

std::optional<std::string> TomlReader::text(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return std::nullopt;
    if (!found->is_string()) refuse(key, "'" + key + "' must be a text in quotes");
    return found->value<std::string>();
}

std::string TomlReader::required_text(const std::string& key) {
    if (auto value = text(key)) return *value;
    throw InvalidInput(place() + ": " + name_ + " lacks '" + key + "'");
}

std::string TomlReader::one_of(const std::string& key, const std::vector<std::string>& names,
                               const std::string& fallback) {
    const std::string value = text(key).value_or(fallback);
    if (std::find(names.begin(), names.end(), value) != names.end()) return value;
    std::string list;
    for (const std::string& name : names) list += (list.empty() ? "'" : ", '") + name + "'";
    const std::string nearest = nearest_name(value, names);
    refuse(key, "'" + key + "' is '" + value + "'; give one of " + list +
                    (nearest.empty() ? "" : " (did you mean '" + nearest + "'?)"));
}

std::vector<std::string> TomlReader::texts(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return {};
    if (found->is_string()) return {*found->value<std::string>()};
    if (!found->is_array()) refuse(key, "'" + key + "' must be a list of texts");
    std::vector<std::string> list;
    for (const toml::node& entry : *found->as_array()) {
        if (!entry.is_string()) refuse(key, "'" + key + "' must be a list of texts");
        list.push_back(*entry.value<std::string>());
    }
    return list;
}

std::vector<int> TomlReader::wholes(const std::string& key, int least, int most) {
    const toml::node* found = node(key);
    if (!found) return {};
    const std::string wanted = fmt::format("'{}' must be a list of whole numbers from {} to {}", key, least, most);
    if (!found->is_array()) refuse(key, wanted);
    std::vector<int> list;
    for (const toml::node& entry : *found->as_array()) {
        const auto value = entry.is_integer() ? entry.value<std::int64_t>() : std::nullopt;
        if (!value || *value < least || *value > most) refuse(key, wanted);
        list.push_back(static_cast<int>(*value));
    }
    return list;
}

std::optional<Eigen::Vector3d> TomlReader::vector(const std::string& key, const Range& range) {
    const toml::node* found = node(key);
    if (!found) return std::nullopt;
    const toml::array* list = found->as_array();
    if (!list || list->size() != 3)
        refuse(key,
               "'" + key + "' must be three numbers, [x, y, z]" + (range.unit.empty() ? "" : " (" + range.unit + ")"));
    Eigen::Vector3d value;
    for (std::size_t i = 0; i < 3; ++i) value[static_cast<Eigen::Index>(i)] = number_of(*list->get(i), key, range);
    return value;
}

Eigen::Vector3d TomlReader::required_vector(const std::string& key, const Range& range) {
    if (const auto value = vector(key, range)) return *value;
    throw InvalidInput(place() + ": " + name_ + " lacks '" + key + "', [x, y, z]" +
                       (range.unit.empty() ? "" : " (" + range.unit + ")"));
}

std::optional<Eigen::Vector3d> TomlReader::direction(const std::string& key) {
    const auto value = vector(key);
    if (!value) return std::nullopt;
    if (!(value->norm() > 0)) refuse(key, "'" + key + "' is a direction and must not be [0, 0, 0]");
    return value->normalized();
}

std::vector<Eigen::Vector2d> TomlReader::pairs(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return {};
    const toml::array* list = found->as_array();
    if (!list || list->empty()) refuse(key, "'" + key + "' must be a list of pairs, [[a, b], ...]");
    std::vector<Eigen::Vector2d> all;
    for (const toml::node& entry : *list) {
        const toml::array* pair = entry.as_array();
        if (!pair || pair->size() != 2) refuse(key, "'" + key + "' must be a list of pairs, [[a, b], ...]");
        all.emplace_back(number_of(*pair->get(0), key, {}), number_of(*pair->get(1), key, {}));
    }
    return all;
}

simulation::Curve TomlReader::curve() {
    simulation::Curve curve;
    for (const Eigen::Vector2d& point : pairs("curve")) curve.points.push_back({point[0], point[1]});
    try {
        simulation::require_valid(curve, "'curve'");
    } catch (const InvalidInput& error) {
        refuse("curve", std::string(error.what()) + "; it is [[s, part], ...]");
    }
    return curve;
}

std::map<int, double> TomlReader::by_label(const std::string& key, const Range& range) {
    const toml::node* found = node(key);
    if (!found) return {};
    const toml::table* table = found->as_table();
    if (!table) refuse(key, "'" + key + "' must be a table of labels, { 1 = 5.0 }");
    std::map<int, double> values;
    for (const auto& [name, entry] : *table) {
        int label = 0;
        const std::string_view text = name.str();
        const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), label);
        if (error != std::errc() || end != text.data() + text.size() || label <= 0)
            refuse(key, "'" + std::string(text) + "' is no label; labels are whole numbers above 0");
        values[label] = number_of(entry, key, range);
    }
    return values;
}

std::optional<TomlReader> TomlReader::table(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return std::nullopt;
    const toml::table* table = found->as_table();
    if (!table) refuse(key, "'" + key + "' must be a table, { ... }");
    return TomlReader(*table, path_, name_.empty() ? "[" + key + "]" : "'" + key + "'");
}

std::vector<TomlReader> TomlReader::tables(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return {};
    if (const toml::table* one = found->as_table()) return {TomlReader(*one, path_, "[" + key + "]")};
    const toml::array* list = found->as_array();
    if (!list) refuse(key, "write [[" + key + "]]");
    std::vector<TomlReader> readers;
    for (const toml::node& entry : *list) {
        if (!entry.is_table()) refuse(key, "write [[" + key + "]]");
        readers.emplace_back(*entry.as_table(), path_, "[[" + key + "]]");
    }
    return readers;
}

std::vector<std::pair<std::string, TomlReader>> TomlReader::named_tables(const std::string& key) {
    const toml::node* found = node(key);
    if (!found) return {};
    const toml::table* all = found->as_table();
    if (!all) refuse(key, "write [" + key + ".<name>]");
    std::vector<std::pair<std::string, TomlReader>> readers;
    for (const auto& [name, entry] : *all) {
        const std::string full = key + "." + std::string(name.str());
        if (!entry.is_table()) throw InvalidInput(toml_place(path_, entry) + ": write [" + full + "]");
        readers.emplace_back(std::string(name.str()), TomlReader(*entry.as_table(), path_, "[" + full + "]"));
    }
    return readers;
}

void TomlReader::finish() const {
    const std::vector<std::string> names(asked_.begin(), asked_.end());
    for (const auto& [key, entry] : table_) {
        const std::string name(key.str());
        if (asked_.contains(name)) continue;
        const std::string nearest = meant(name, names);
        throw InvalidInput(toml_place(path_, entry) + ": unknown key '" + name + "'" +
                           (name_.empty() ? "" : " in " + name_) +
                           (nearest.empty() ? "; see docs/manual/scene-file.md" : "; did you mean '" + nearest + "'?"));
    }
}

}  // namespace tissuewarp::apps
