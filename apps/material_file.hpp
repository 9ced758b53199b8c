#pragma once
/// Material tables: what each label of a map is made of.

#include "tled/material.hpp"

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// A tissue as a person writes it.
struct TissueEntry {
    std::string name;               ///< for messages and reports
    double youngs_modulus_kpa = 0;  ///< kPa
    double poissons_ratio = 0;
    std::string law = "neo-hookean-lnj";  ///< or "neo-hookean-iso"
};

/// Throws InvalidInput for an unknown law or moduli out of range.
tled::Material material_of(const TissueEntry& entry);

/// That of a name in registration/tissues.hpp. Throws InvalidInput where there is none.
TissueEntry entry_of_tissue(const std::string& name);

/// Reads [label.<n>] tables. Throws IoError, InvalidInput with file and line.
std::map<int, TissueEntry> read_materials(const std::filesystem::path& path);

/// Throws InvalidInput that names each label without an entry.
void require_materials(const std::map<int, TissueEntry>& table, const std::vector<int>& labels,
                       const std::filesystem::path& path);

}  // namespace tissuewarp::apps
