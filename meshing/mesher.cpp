#include "meshing/mesher.hpp"

#include "imaging/labels.hpp"
#include "meshing/detail/delaunay_refinement.hpp"
#include "meshing/detail/relaxation.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <sstream>
#include <string>

namespace tissuewarp::meshing {

namespace {

using detail::LabelGrid;

constexpr double most_tets = 5e7;  // about 20 GB inside CGAL

/// Volume of the regular tetrahedron.
double tet_volume(double edge) {
    return edge * edge * edge / (6.0 * std::sqrt(2.0));
}

void require_options(const MeshingOptions& options) {
    const auto require = [](bool good, const char* name, double value, const char* remedy) {
        if (!good)
            throw InvalidInput(std::string("mesh_labels: ") + name + " is " + std::to_string(value) + "; " + remedy);
    };
    require(options.edge_length > 0.0 && std::isfinite(options.edge_length), "edge_length", options.edge_length,
            "give a positive length in mm");
    for (const auto& [label, edge] : options.label_edge_length)
        require(edge > 0.0 && std::isfinite(edge), "label_edge_length", edge, "give a positive length in mm");
    require(options.facet_distance >= 0.0, "facet_distance", options.facet_distance, "give mm, or 0 for the default");
    require(options.facet_angle >= 0.0 && options.facet_angle <= 30.0, "facet_angle", options.facet_angle,
            "give 0 to 30 degrees: refinement may not end beyond");
    require(options.radius_edge_ratio >= 2.0, "radius_edge_ratio", options.radius_edge_ratio,
            "give 2 or more: refinement may not end below");
    require(options.smoothing >= 0.0 && options.smoothing <= 3.0, "smoothing", options.smoothing, "give 0 to 3 voxels");
}

/// Target edge of each class, mm; of background the coarsest.
std::vector<double> edge_lengths(const LabelGrid& grid, const MeshingOptions& options) {
    std::vector<double> edges(grid.values.size(), options.edge_length);
    for (std::size_t c = 1; c < edges.size(); ++c) {
        const auto own = options.label_edge_length.find(grid.values[c]);
        if (own != options.label_edge_length.end()) edges[c] = own->second;
    }
    edges[0] = *std::max_element(edges.begin() + 1, edges.end());
    return edges;
}

void require_affordable(const LabelGrid& grid, const std::vector<double>& edges) {
    std::vector<double> voxels(edges.size(), 0.0);
    for (std::uint16_t c : grid.classes) voxels[c] += 1.0;
    double tets = 0.0;
    for (std::size_t c = 1; c < edges.size(); ++c) tets += voxels[c] * grid.spacing.prod() / tet_volume(edges[c]);
    if (tets <= most_tets) return;
    throw InvalidInput("mesh_labels: these edge lengths ask for about " + std::to_string(std::llround(tets / 1e6)) +
                       " million tetrahedra; at most " + std::to_string(std::llround(most_tets / 1e6)) +
                       " million are made: use an edge of " +
                       std::to_string(*std::min_element(edges.begin(), edges.end()) * std::cbrt(tets / most_tets)) +
                       " mm or more");
}

/// Thousands of pieces are mostly noise or a broken shell, and each is meshed.
void note_scattered(const imaging::Volume& labels, const std::vector<int>& chosen, Observer& observer) {
    constexpr int many = 1000;
    for (const auto& [label, statistics] : imaging::label_statistics(labels)) {
        const bool meshed = chosen.empty() || std::find(chosen.begin(), chosen.end(), label) != chosen.end();
        if (meshed && statistics.components >= many)
            observer.note("meshing: label " + std::to_string(label) + " lies in " +
                          std::to_string(statistics.components) +
                          " pieces that do not touch, as noise and broken shells do; meshing takes long: remove small "
                          "pieces first");
    }
}

/// Pieces below half a tetrahedron of the target size cannot be shown by the mesh and would only force tiny elements.
void drop_specks(LabelGrid& grid, const std::vector<double>& edges, Observer& observer) {
    std::vector<double> voxels(edges.size());
    for (std::size_t c = 0; c < edges.size(); ++c) voxels[c] = 0.5 * tet_volume(edges[c]) / grid.spacing.prod();
    if (const int removed = detail::remove_specks(grid, voxels); removed > 0)
        observer.note("meshing: " + std::to_string(removed) +
                      " disconnected pieces of labels or cavities, each smaller than half an element, were given to "
                      "their surroundings");
}

/// Refines, and again with a finer edge for classes that are thinner than their elements and got none.
TetMesh refine_every_label(const LabelGrid& grid, const detail::LabelField& field, std::vector<double> edges,
                           double facet_distance, const MeshingOptions& options, Observer& observer) {
    constexpr int most_attempts = 5;  // the last one with a sixteenth of the edge
    std::vector<char> thin(edges.size(), 0);
    for (int attempt = 1;; ++attempt) {
        const auto seeds = detail::surface_seeds(grid, field, edges, thin, observer);
        const auto refine =
            options.refinement == Refinement::Parallel ? detail::refine_parallel : detail::refine_sequential;
        TetMesh mesh = refine({grid, field, seeds, edges, facet_distance, options}, observer);
        std::vector<char> missing(edges.size(), 1);
        missing[0] = 0;
        for (int label : mesh.labels) missing[static_cast<std::size_t>(label)] = 0;
        if (std::count(missing.begin(), missing.end(), 1) == 0) return mesh;
        for (std::size_t c = 1; c < edges.size(); ++c) {
            if (!missing[c]) continue;
            edges[c] *= 0.5;
            thin[c] = 1;
            const std::string label = "meshing: label " + std::to_string(grid.values[c]);
            observer.note(attempt < most_attempts
                              ? label + " is thinner than its elements; its edge length becomes " +
                                    std::to_string(edges[c]) + " mm"
                              : label + " is too thin to be meshed and is absent; give it a label_edge_length below " +
                                    std::to_string(edges[c]) + " mm or thicken it");
        }
        if (attempt == most_attempts) return mesh;
    }
}

/// What is thinner than its elements may leave a few of them, which stand for nothing.
void require_volume(const TetMesh& mesh, const LabelGrid& grid, const std::vector<double>& edges, Observer& observer) {
    constexpr double least_share = 0.5;
    std::vector<double> meshed(edges.size(), 0.0), stated(edges.size(), 0.0);
    const Eigen::VectorXd volumes = tet_volumes(mesh);
    for (Eigen::Index t = 0; t < volumes.size(); ++t) meshed[static_cast<std::size_t>(mesh.labels[t])] += volumes[t];
    for (const std::uint16_t c : grid.classes) stated[c] += grid.spacing.prod();
    meshed[0] = stated[0] = 0.0;
    const auto what = [](double volume, double of, double edge) {
        std::ostringstream text;
        text << volume << " of " << of << " mm3 are meshed: it is thinner than its elements; give it an edge length "
             << "below " << 0.5 * edge << " mm, or thicken it";
        return text.str();
    };
    const double all_meshed = std::accumulate(meshed.begin(), meshed.end(), 0.0),
                 all_stated = std::accumulate(stated.begin(), stated.end(), 0.0);
    if (all_meshed < least_share * all_stated)
        throw InvalidInput("mesh_labels: of the tissue " +
                           what(all_meshed, all_stated, *std::max_element(edges.begin(), edges.end())));
    for (std::size_t c = 1; c < edges.size(); ++c)
        if (meshed[c] < least_share * stated[c])
            observer.note("meshing: of label " + std::to_string(grid.values[c]) + " " +
                          what(meshed[c], stated[c], edges[c]));
}

/// Local frame → LPS, classes → label values, orientation repaired where the image's axes are left-handed.
void place(TetMesh& mesh, const LabelGrid& grid, const imaging::Geometry& geometry) {
    const Eigen::Vector3d corner = geometry.point(Eigen::Vector3d(grid.origin[0], grid.origin[1], grid.origin[2]));
    mesh.nodes = (geometry.direction * mesh.nodes).colwise() + corner;
    if (geometry.direction.determinant() < 0.0) mesh.tets.row(2).swap(mesh.tets.row(3));
    for (int& label : mesh.labels) label = grid.values[static_cast<std::size_t>(label)];
}

}  // namespace

TetMesh mesh_labels(const imaging::Volume& labels, const MeshingOptions& options, Observer& observer) {
    require_options(options);
    observer.checkpoint("reading the labels", 0.0);
    const int padding = 1 + std::max(1, static_cast<int>(std::ceil(2.5 * options.smoothing)));
    LabelGrid grid = detail::make_label_grid(labels, options.labels, padding);
    const std::vector<double> edges = edge_lengths(grid, options);
    require_affordable(grid, edges);
    note_scattered(labels, options.labels, observer);
    drop_specks(grid, edges, observer);

    observer.checkpoint("smoothing the labels", 0.02);
    const detail::LabelField field(grid, options.smoothing);
    const double shortest = *std::min_element(edges.begin() + 1, edges.end());
    const double distance = options.facet_distance > 0.0
                                ? options.facet_distance
                                : std::max(0.12 * shortest, 0.25 * std::cbrt(grid.spacing.prod()));
    TetMesh mesh = refine_every_label(grid, field, edges, distance, options, observer);
    require_valid(mesh, "refined labels");
    observer.checkpoint("relaxing the mesh", 0.9);
    detail::relax(mesh, {field, edges, grid.spacing.minCoeff(), distance, options.min_dihedral_deg});
    require_volume(mesh, grid, edges, observer);
    place(mesh, grid, labels.geometry);
    require_valid(mesh, "mesh_labels");
    observer.progress("meshing", 1.0);
    return mesh;
}

}  // namespace tissuewarp::meshing
