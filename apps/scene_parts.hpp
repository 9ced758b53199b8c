#pragma once
/// The parts of a scene file, each read by a function. Included by the sources of scene_file alone.

#include "apps/toml_reader.hpp"
#include "core/observer.hpp"
#include "simulation/scene.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// Names of one part that another has to hold, with the line that says them: looked up when all is read.
struct NameUses {
    struct Label {
        int label = 0;
        std::string place, role;
    };
    struct Set {
        std::string set, place;
    };
    std::vector<Label> tissue_labels;  ///< that a tissue must have
    std::vector<Label> volume_labels;  ///< that the label volume must hold
    std::vector<Set> sets;
    /// Labels whose fibres are a cell array of the mesh.
    struct FibreArray {
        int label = 0;
        std::string array, place;
    };
    std::vector<FibreArray> fibre_arrays;
    std::string geometry_notes;  ///< what its reader said, "; " before each, for messages about labels
};

constexpr double largest_length = 1e4;  // mm
inline const Range any_length{-largest_length, largest_length, "mm"};
inline const Range positive_length{1e-6, largest_length, "mm"};

void read_tissues(TomlReader& file, const std::filesystem::path& folder, simulation::Scene& scene, NameUses& uses,
                  Observer& observer);
/// The fibres that `uses` names too.
void read_geometry(TomlReader& file, const std::filesystem::path& folder, simulation::Scene& scene, NameUses& uses,
                   Observer& observer);
void read_sets(TomlReader& file, simulation::Scene& scene, NameUses& uses);
void read_loads(TomlReader& file, simulation::Scene& scene, NameUses& uses);
void read_neighbours(TomlReader& file, const std::filesystem::path& folder, simulation::Scene& scene, NameUses& uses,
                     Observer& observer);
void read_solve(TomlReader& file, simulation::Scene& scene);

/// `displacement_mm` and `rotation`, neither of them required.
simulation::RigidMotion read_rigid_motion(TomlReader& reader);
simulation::Box read_box(TomlReader reader);
simulation::Ball read_ball(TomlReader reader);
simulation::HalfSpace read_half_space(TomlReader reader);

}  // namespace tissuewarp::apps
