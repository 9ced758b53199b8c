// TOML: tables of materials, configurations of verbs, scenes with the meshes and label maps that they name.

#include "apps/config_file.hpp"
#include "apps/material_file.hpp"
#include "apps/scene_file.hpp"
#include "apps/scene_templates.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/primitives.hpp"
#include "tests/fuzz/format.hpp"

namespace tissuewarp::fuzz {

namespace {

void read_materials(const std::filesystem::path& path, Digest& digest) {
    for (const auto& [label, entry] : apps::read_materials(path)) {
        digest.number(label);
        digest.text(entry.name + entry.law);
        digest.number(entry.youngs_modulus_kpa);
        digest.number(entry.poissons_ratio);
    }
}

void read_config(const std::filesystem::path& path, Digest& digest) {
    for (const std::string& argument :
         apps::read_config(path, {{"moving", "edge-length", "threads", "seed", "quiet"}, {"quiet"}}))
        digest.text(argument);
}

void read_scene(const std::filesystem::path& path, Digest& digest) {
    const simulation::Scene scene = apps::read_scene(path);
    digest.text(scene.title);
    digest.number(scene.tissues.size());
}

std::vector<Seed> material_seeds(const std::filesystem::path&) {
    return {single("m.toml",
                   "# kPa\n[label.1]\nname = \"brain\"\nyoungs_modulus_kpa = 3.0\npoissons_ratio = 0.45\n\n"
                   "[label.7]\nname = \"tumour\"\nlaw = \"neo-hookean-iso\"\nyoungs_modulus_kpa = 9\n"
                   "poissons_ratio = 0.31\n")};
}

std::vector<Seed> config_seeds(const std::filesystem::path&) {
    return {
        single("c.toml", "moving = \"a.nii.gz\"\nedge-length = 4.5\nthreads = 2\nquiet = true\nseed = [\"1\", 2]\n")};
}

std::vector<Seed> scene_seeds(const std::filesystem::path& folder) {
    std::vector<Seed> seeds;
    for (const std::string& name : apps::scene_template_names()) {
        const apps::SceneTemplate scene = apps::scene_template(name, "labels.nii.gz");
        if (scene.labels.empty()) seeds.push_back(single(name + ".toml", scene.text));
    }
    meshing::write_vtu(meshing::box_mesh({30, 20, 20}, {2, 1, 1}), folder / "mesh.vtu");
    seeds.push_back({{{"mesh.toml",
                       {"title = \"a mesh\"\n[geometry]\nmesh = \"mesh.vtu\"\n[label.1]\nyoungs_modulus_kpa = 3\n"
                        "poissons_ratio = 0.45\n[set.base]\nside = \"-z\"\n[[fixed]]\nset = \"base\"\n"
                        "[gravity]\nto = [0, 0, -1]\n",
                        ""}},
                      {"mesh.vtu", {bytes_at(folder / "mesh.vtu"), ""}}},
                     "mesh.toml"});
    return seeds;
}

}  // namespace

std::vector<Format> toml_formats() {
    return {{"materials", material_seeds, read_materials},
            {"config", config_seeds, read_config},
            {"scene", scene_seeds, read_scene}};
}

}  // namespace tissuewarp::fuzz
