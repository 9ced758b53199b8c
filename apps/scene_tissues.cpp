// [label.<n>]: what each label is made of.

#include "apps/noted_images.hpp"
#include "apps/parameters.hpp"
#include "apps/scene_parts.hpp"
#include "simulation/presets.hpp"

#include <charconv>

namespace tissuewarp::apps {

namespace {

const Range modulus{1e-6, 1e6, "kPa"};
const Range any_modulus{-1e6, 1e6, "kPa"};

std::vector<std::string> preset_names() {
    std::vector<std::string> names;
    for (const simulation::Preset& preset : simulation::presets()) names.push_back(preset.name);
    return names;
}

tled::Material ogden(TomlReader& tissue) {
    tled::Ogden law;
    const auto terms = tissue.pairs("terms");
    if (terms.empty() || terms.size() > law.terms.size())
        tissue.refuse("terms", "an ogden law has one to three 'terms', [[modulus kPa, exponent], ...]");
    for (std::size_t t = 0; t < terms.size(); ++t) law.terms[t] = {terms[t][0], terms[t][1]};
    law.bulk_modulus = tissue.required_number("bulk_modulus_kpa", modulus);
    return law;
}

tled::Material polynomial(TomlReader& tissue, const std::string& law) {
    const double bulk = tissue.required_number("bulk_modulus_kpa", modulus);
    const auto c = [&](const char* key) { return tissue.required_number(key, any_modulus); };
    if (law == "mooney-rivlin") return tled::mooney_rivlin(c("c10_kpa"), c("c01_kpa"), bulk);
    return tled::yeoh(c("c10_kpa"), c("c20_kpa"), c("c30_kpa"), bulk);
}

/// `fibre` in the material, or one of the fields.
void read_fibres(TomlReader& reader, const std::filesystem::path& folder, int label, simulation::Tissue& tissue,
                 NameUses& uses, Observer& observer) {
    auto* law = std::get_if<tled::TransverselyIsotropic>(&tissue.material);
    if (!law) return;
    const auto direction = reader.direction("fibre");
    const auto file = reader.text("fibre_file"), array = reader.text("fibre_array");
    if (direction) law->fibre = *direction;
    if (array) uses.fibre_arrays.push_back({label, *array, reader.place("fibre_array")});
    if (!file) return;
    const imaging::Volume volume = read_noted_volume(folder / *file, observer);
    if (volume.channels() != 3)
        reader.refuse("fibre_file",
                      "'" + *file + "' has one number a voxel; fibres are vectors of three components, LPS");
    tissue.fibres = simulation::FibreVolume{volume.as(CV_32F)};
}

/// After finish(), which names a misspelt one.
void require_fibres(const TomlReader& reader, const tled::Material& material) {
    if (!std::holds_alternative<tled::TransverselyIsotropic>(material)) return;
    if (int(reader.has("fibre")) + int(reader.has("fibre_file")) + int(reader.has("fibre_array")) != 1)
        throw InvalidInput(reader.place() +
                           ": a transversely-isotropic tissue takes one of 'fibre', [x, y, z], 'fibre_file', a volume "
                           "of vectors, and 'fibre_array', a cell array of the mesh");
}

tled::Material transversely_isotropic(TomlReader& tissue) {
    tled::TransverselyIsotropic law;
    law.shear_modulus = tissue.required_number("shear_modulus_kpa", modulus);
    law.bulk_modulus = tissue.required_number("bulk_modulus_kpa", modulus);
    law.fibre_modulus = tissue.required_number("fibre_modulus_kpa", modulus);
    return law;
}

tled::Material arruda_boyce(TomlReader& tissue) {
    return tled::ArrudaBoyce{tissue.required_number("shear_modulus_kpa", modulus),
                             tissue.required_number("locking_stretch", {1.0 + 1e-6, 100.0}),
                             tissue.required_number("bulk_modulus_kpa", modulus)};
}

tled::Material material_of(TomlReader& tissue) {
    const std::string law = tissue.one_of("law",
                                          {"neo-hookean-lnj", "neo-hookean-iso", "neo-hookean-stable", "mooney-rivlin",
                                           "yeoh", "arruda-boyce", "ogden", "transversely-isotropic"},
                                          "neo-hookean-lnj");
    if (law == "ogden") return ogden(tissue);
    if (law == "arruda-boyce") return arruda_boyce(tissue);
    if (law == "transversely-isotropic") return transversely_isotropic(tissue);
    if (law == "mooney-rivlin" || law == "yeoh") return polynomial(tissue, law);
    const double youngs_modulus = tissue.required_number("youngs_modulus_kpa", modulus);
    const double poissons_ratio = tissue.required_number("poissons_ratio", {0.0, 0.4999});
    if (law == "neo-hookean-iso") return tled::neo_hookean_iso(youngs_modulus, poissons_ratio);
    if (law == "neo-hookean-stable") return tled::neo_hookean_stable(youngs_modulus, poissons_ratio);
    return tled::neo_hookean_lnj(youngs_modulus, poissons_ratio);
}

simulation::Tissue tissue_of(TomlReader& reader, const std::filesystem::path& folder, int label, NameUses& uses,
                             Observer& observer) {
    simulation::Tissue tissue;
    tissue.name = reader.text("name").value_or("");
    tissue.growth = reader.number("growth", {0.2, 5.0}).value_or(1.0);
    if (reader.has("preset")) {
        const auto& preset = simulation::preset(reader.one_of("preset", preset_names(), ""));
        tissue.material = preset.material;
        tissue.viscosity = preset.viscosity;
        if (tissue.name.empty()) tissue.name = preset.name;
    } else {
        (void)reader.text("preset");  // a name that misspelt keys may mean
        tissue.material = material_of(reader);
    }
    read_fibres(reader, folder, label, tissue, uses, observer);
    if (reader.has("prony")) tissue.viscosity.terms.clear();
    for (const Eigen::Vector2d& term : reader.pairs("prony")) tissue.viscosity.terms.push_back({term[0], term[1]});
    try {
        tled::require_valid(tissue.material, reader.place());
        tled::require_valid(tissue.viscosity, reader.place());
    } catch (const InvalidInput& error) {
        throw InvalidInput(reader.place() + ": " + error.what());
    }
    return tissue;
}

}  // namespace

void read_tissues(TomlReader& file, const std::filesystem::path& folder, simulation::Scene& scene, NameUses& uses,
                  Observer& observer) {
    for (auto& [name, reader] : file.named_tables("label")) {
        int label = 0;
        const auto [end, failure] = std::from_chars(name.data(), name.data() + name.size(), label);
        if (failure != std::errc() || end != name.data() + name.size() || label <= 0)
            throw InvalidInput(reader.place() + ": '" + name + "' is no label; write [label.1], [label.2], ...");
        scene.tissues[label] = tissue_of(reader, folder, label, uses, observer);
        reader.finish();
        require_fibres(reader, scene.tissues[label].material);
        uses.volume_labels.push_back({label, reader.place(), "has a tissue"});
    }
    if (scene.tissues.empty())
        throw InvalidInput(file.place() + ": the scene has no tissue; write a table [label.1] for each label");
    scene.density = 1e-9 * file.number("density_kg_m3", {100.0, 10000.0, "kg/m3"}).value_or(1000.0);
}

}  // namespace tissuewarp::apps
