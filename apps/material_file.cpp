#include "apps/material_file.hpp"

#include "apps/parameters.hpp"
#include "apps/toml_file.hpp"
#include "core/file_message.hpp"
#include "registration/tissues.hpp"

#include <charconv>

namespace tissuewarp::apps {

namespace {

int label_of(const std::string& text, const std::string& place) {
    int label = 0;
    const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), label);
    if (failure != std::errc() || end != text.data() + text.size() || label <= 0)
        throw InvalidInput(place + ": '" + text + "' is no label; write [label.1], [label.2], ...");
    return label;
}

double number(const toml::node& node, const std::string& name, const std::string& place) {
    if (const auto value = node.value<double>()) return *value;
    throw InvalidInput(place + ": '" + name + "' must be a number");
}

std::string text(const toml::node& node, const std::string& name, const std::string& place) {
    if (const auto* value = node.as_string()) return value->get();
    throw InvalidInput(place + ": '" + name + "' must be a text in quotes");
}

TissueEntry entry_of(const toml::table& table, const std::filesystem::path& path) {
    const std::vector<std::string> names{"name", "youngs_modulus_kpa", "poissons_ratio", "law"};
    TissueEntry entry;
    for (const auto& [key, node] : table) {
        const std::string name(key.str());
        const std::string place = toml_place(path, node);
        if (name == "name")
            entry.name = text(node, name, place);
        else if (name == "law")
            entry.law = text(node, name, place);
        else if (name == "youngs_modulus_kpa")
            entry.youngs_modulus_kpa = number(node, name, place);
        else if (name == "poissons_ratio")
            entry.poissons_ratio = number(node, name, place);
        else
            throw InvalidInput(place + ": unknown key '" + name + "'; did you mean '" +
                               (nearest_name(name, names).empty() ? names[1] : nearest_name(name, names)) + "'?");
    }
    for (const char* required : {"youngs_modulus_kpa", "poissons_ratio"})
        if (!table.contains(required))
            throw InvalidInput(toml_place(path, table) + ": this label lacks '" + required + "'");
    try {
        material_of(entry);
    } catch (const InvalidInput& error) {
        throw InvalidInput(toml_place(path, table) + ": " + error.what());
    }
    return entry;
}

}  // namespace

tled::Material material_of(const TissueEntry& entry) {
    if (entry.law == "neo-hookean-lnj") return tled::neo_hookean_lnj(entry.youngs_modulus_kpa, entry.poissons_ratio);
    if (entry.law == "neo-hookean-iso") return tled::neo_hookean_iso(entry.youngs_modulus_kpa, entry.poissons_ratio);
    throw InvalidInput("unknown law '" + entry.law + "'; give neo-hookean-lnj or neo-hookean-iso");
}

TissueEntry entry_of_tissue(const std::string& name) {
    const registration::Tissue& tissue = registration::tissue_named(name);
    const double poissons_ratio = tled::poisson_ratio(tissue.material);
    return {tissue.name, 2 * tled::shear_modulus(tissue.material) * (1 + poissons_ratio), poissons_ratio};
}

namespace {

std::map<int, TissueEntry> read_checked(const std::filesystem::path& path) {
    const toml::table file = parse_toml_file(path);
    for (const auto& [key, node] : file)
        if (key.str() != "label")
            throw InvalidInput(toml_place(path, node) + ": unknown key '" + std::string(key.str()) +
                               "'; a material table holds [label.<number>] tables only");
    const toml::table* labels = file["label"].as_table();
    if (!labels)
        throw InvalidInput("'" + path.string() + "' holds no material; write a table [label.1] for each label");
    std::map<int, TissueEntry> table;
    for (const auto& [key, node] : *labels) {
        const int label = label_of(std::string(key.str()), toml_place(path, node));
        if (!node.is_table())
            throw InvalidInput(toml_place(path, node) + ": write [label." + std::to_string(label) + "]");
        table[label] = entry_of(*node.as_table(), path);
    }
    return table;
}

}  // namespace

std::map<int, TissueEntry> read_materials(const std::filesystem::path& path) {
    return naming(path, [&] { return read_checked(path); });
}

void require_materials(const std::map<int, TissueEntry>& table, const std::vector<int>& labels,
                       const std::filesystem::path& path) {
    std::string missing;
    for (const int label : labels)
        if (!table.contains(label)) missing += (missing.empty() ? "" : ", ") + std::to_string(label);
    if (missing.empty()) return;
    throw InvalidInput("label " + missing + " of the moving labels has no material in '" + path.string() +
                       "'; add [label." + missing.substr(0, missing.find(',')) +
                       "] with youngs_modulus_kpa and poissons_ratio, or remove the label from the map");
}

}  // namespace tissuewarp::apps
