// tissuewarp mesh: label map → tetrahedra, with the quality and the fidelity of what was made.

#include "apps/inputs.hpp"
#include "apps/module_description.hpp"
#include "apps/noted_images.hpp"
#include "apps/output_folder.hpp"
#include "apps/progress.hpp"
#include "apps/report_json.hpp"
#include "apps/verbs.hpp"
#include "core/atomic_file.hpp"
#include "imaging/labels.hpp"
#include "meshing/mesh_io.hpp"
#include "meshing/mesher.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

namespace {

void print_row(const char* name, const meshing::Distribution& d) {
    fmt::print("  {:<24}{:>9.3g}{:>9.3g}{:>9.3g}{:>9.3g}{:>9.3g}\n", name, d.minimum, d.percentile_1, d.median,
               d.percentile_99, d.maximum);
}

void print_report(const meshing::TetMesh& mesh, const meshing::QualityReport& quality,
                  const meshing::Fidelity& fidelity) {
    fmt::print("{} nodes, {} tetrahedra, {} pieces\n", mesh.node_count(), mesh.tet_count(), quality.components);
    fmt::print("  {:<24}{:>9}{:>9}{:>9}{:>9}{:>9}\n", "", "minimum", "1st", "median", "99th", "maximum");
    print_row("least dihedral (deg)", quality.min_dihedral_deg);
    print_row("largest dihedral (deg)", quality.max_dihedral_deg);
    print_row("radius over edge", quality.radius_edge);
    print_row("volume (mm3)", quality.volume_mm3);
    print_row("edge (mm)", quality.edge_mm);
    fmt::print("explicit time steps are limited by tetrahedron {}: 1/sqrt(sum |grad N|^2) = {:.3f} mm\n",
               quality.step_limiting_tet, quality.step_limit_mm);
    for (const auto& [label, volume] : quality.label_volume_mm3)
        fmt::print("label {}: {:.1f} mm3, {:.3f} of its voxels\n", label, volume, fidelity.volume_ratio.at(label));
    fmt::print("distance to the label boundary: mean {:.3f} mm, 95th percentile {:.3f} mm, largest {:.3f} mm\n",
               fidelity.mean_surface_distance_mm, fidelity.hausdorff_95_mm, fidelity.hausdorff_mm);
}

}  // namespace

void run_mesh(const MeshOptions& options) {
    ProgressLine progress(options.common);
    if (options.output.extension() != ".vtu")
        throw InvalidInput("'" + options.output.string() + "' is not a .vtu file; give a name that ends in .vtu");
    require_could_write_file(options.output);
    if (!options.json.empty()) require_could_write_file(options.json);
    progress.begin("reading", 0.0, 0.05);
    const imaging::Volume labels = read_noted_labels(options.labels, progress);
    imaging::require_labels(labels, options.only, options.labels.string().c_str());
    require_labels_of_lengths(options.label_edge_length, labels, options.labels);

    progress.begin("meshing", 0.05, 0.9);
    meshing::MeshingOptions meshing_options;
    meshing_options.edge_length = options.edge_length;
    meshing_options.label_edge_length = options.label_edge_length;
    meshing_options.facet_distance = options.facet_distance;
    meshing_options.smoothing = options.smoothing;
    meshing_options.labels = options.only;
    if (options.refinement == "parallel") meshing_options.refinement = meshing::Refinement::Parallel;
    const meshing::TetMesh mesh = meshing::mesh_labels(labels, meshing_options, progress);

    progress.begin("measuring", 0.9, 1.0);
    const meshing::QualityReport quality = meshing::quality(mesh);
    const meshing::Fidelity fidelity = meshing::fidelity(mesh, labels);
    AtomicFile file(options.output);
    meshing::write_vtu(mesh, file.path());
    if (!options.json.empty()) {
        nlohmann::json report{{"schema", "tissuewarp.mesh"}, {"schema_version", 1},
                              {"nodes", mesh.node_count()},  {"tetrahedra", mesh.tet_count()},
                              {"quality", to_json(quality)}, {"fidelity", to_json(fidelity)},
                              {"notes", progress.notes()}};
        write_json(report, options.json);
    }
    file.commit();
    write_return_parameters(options.common.return_parameters, {{"tetrahedra", std::to_string(mesh.tet_count())}});
    progress.clear();
    if (options.common.quiet) return;
    print_report(mesh, quality, fidelity);
    for (const std::string& note : progress.notes()) fmt::print("note: {}\n", note);
}

}  // namespace tissuewarp::apps
