#pragma once
/// A TOML table read key by key: each key is asked for with its unit and range, and what nobody asked for is refused
/// with the line and the nearest name that was. Included by few sources: toml++ is heavy.

#include "apps/toml_file.hpp"
#include "simulation/curve.hpp"

#include <Eigen/Core>

#include <limits>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// A range with its unit, for messages: "mm", "kPa", … or "" for plain numbers.
struct Range {
    double least = -std::numeric_limits<double>::max(), most = std::numeric_limits<double>::max();
    std::string unit{};
};

/// Every getter throws InvalidInput with file and line for a value of the wrong kind or out of range.
class TomlReader {
public:
    /// `name` stands for the table in messages: "[geometry]". Holds references.
    TomlReader(const toml::table& table, const std::filesystem::path& path, std::string name);

    std::optional<double> number(const std::string& key, const Range& range);
    double required_number(const std::string& key, const Range& range);
    std::optional<int> whole(const std::string& key, int least, int most);
    std::optional<bool> flag(const std::string& key);
    std::optional<std::string> text(const std::string& key);
    std::string required_text(const std::string& key);
    /// One of `names`; `fallback` where the key is absent.
    std::string one_of(const std::string& key, const std::vector<std::string>& names, const std::string& fallback);
    std::vector<std::string> texts(const std::string& key);
    std::vector<int> wholes(const std::string& key, int least, int most);
    /// Three numbers; an empty optional where the key is absent.
    std::optional<Eigen::Vector3d> vector(const std::string& key, const Range& range = {});
    Eigen::Vector3d required_vector(const std::string& key, const Range& range = {});
    /// The unit vector along three numbers that are not all 0.
    std::optional<Eigen::Vector3d> direction(const std::string& key);
    /// [[a, b], …].
    std::vector<Eigen::Vector2d> pairs(const std::string& key);
    /// [[s, part], …] under the key "curve".
    simulation::Curve curve();
    /// { 1 = 5.0, … }: numbers by label.
    std::map<int, double> by_label(const std::string& key, const Range& range);
    std::optional<TomlReader> table(const std::string& key);
    /// [[key]], or the one table [key].
    std::vector<TomlReader> tables(const std::string& key);
    /// Tables by their names: [key.name].
    std::vector<std::pair<std::string, TomlReader>> named_tables(const std::string& key);

    [[nodiscard]] bool has(const std::string& key) const { return table_.contains(key); }
    /// "'scene.toml', line 3", of a key or of the table.
    [[nodiscard]] std::string place(const std::string& key) const;
    [[nodiscard]] std::string place() const { return toml_place(path_, table_); }
    /// Throws about a key.
    [[noreturn]] void refuse(const std::string& key, const std::string& message) const;

    /// Throws for a key that was not asked for.
    void finish() const;

private:
    const toml::node* node(const std::string& key);
    [[nodiscard]] double number_of(const toml::node& node, const std::string& key, const Range& range) const;
    [[nodiscard]] std::string number_place(const toml::node& node) const { return toml_place(path_, node); }

    const toml::table& table_;
    const std::filesystem::path& path_;
    std::string name_;
    std::set<std::string> asked_;
};

}  // namespace tissuewarp::apps
