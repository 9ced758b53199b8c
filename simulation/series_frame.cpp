#include "simulation/series_frame.hpp"

#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "simulation/series_io.hpp"

#include <string>
#include <vector>

namespace tissuewarp::simulation {

namespace {

/// Some tetrahedra of a mesh, and the nodes of the whole that are theirs.
struct Part {
    meshing::TetMesh mesh;
    std::vector<int> node;
};

Part part_of(const meshing::TetMesh& whole, const std::vector<int>& tets) {
    Part part;
    std::vector<int> place(static_cast<std::size_t>(whole.node_count()), -1);
    for (const int tet : tets)
        for (const int node : whole.tets.col(tet)) place[static_cast<std::size_t>(node)] = 0;
    for (std::size_t n = 0; n < place.size(); ++n)
        if (place[n] == 0) {
            place[n] = static_cast<int>(part.node.size());
            part.node.push_back(static_cast<int>(n));
        }
    part.mesh.nodes = Eigen::Matrix3Xd(whole.nodes(Eigen::all, part.node));
    part.mesh.tets = Eigen::Matrix4Xi(whole.tets(Eigen::all, tets));
    part.mesh.labels = Eigen::VectorXi(whole.labels(tets));
    for (int& node : part.mesh.tets.reshaped()) node = place[static_cast<std::size_t>(node)];
    return part;
}

/// By tetrahedron whether it is left in a stage.
std::vector<bool> left_in(const Hdf5Input& record, int stage, int tets, const std::string& path) {
    if (stage == 0) return std::vector<bool>(static_cast<std::size_t>(tets), true);
    std::vector<bool> left(static_cast<std::size_t>(tets), false);
    for (const int tet : record.vector<int>("remaining/" + std::to_string(stage))) {
        if (tet < 0 || tet >= tets)
            throw InvalidInput("'" + path + "' names tetrahedron " + std::to_string(tet) + " of " +
                               std::to_string(tets) + " as left; simulate the scene again");
        left[static_cast<std::size_t>(tet)] = true;
    }
    return left;
}

}  // namespace

SeriesFrame read_frame(const std::filesystem::path& path, int index) {
    const Hdf5Input record(path, series_format, series_version, 1);
    const meshing::TetMesh whole{record.columns<double>("mesh/nodes", 3), record.columns<int>("mesh/tetrahedra", 4),
                                 record.vector<int>("mesh/labels")};
    meshing::require_valid(whole, path.c_str());
    const std::vector<hsize_t> shape{static_cast<hsize_t>(whole.node_count()), 3};
    const int frames = static_cast<int>(record.entries("displacement", shape));
    SeriesFrame frame;
    frame.index = index == -1 ? frames - 1 : index;
    if (frame.index < 0 || frame.index >= frames)
        throw InvalidInput("'" + path.string() + "' has no frame " + std::to_string(frame.index) +
                           "; it holds frames 0 (at rest) to " + std::to_string(frames - 1));
    frame.time = record.vector<double>("time", frames)[frame.index];
    const std::vector<bool> left =
        left_in(record, record.vector<int>("stage", frames)[frame.index], whole.tet_count(), path.string());
    std::vector<int> there, gone;
    for (int tet = 0; tet < whole.tet_count(); ++tet)
        (left[static_cast<std::size_t>(tet)] ? there : gone).push_back(tet);
    Eigen::Matrix3Xd displacement(3, whole.node_count());
    record.entry("displacement", static_cast<hsize_t>(frame.index), displacement.data(), shape);
    Part part = part_of(whole, there);
    frame.displacement = Eigen::Matrix3Xd(displacement(Eigen::all, part.node));
    if (there.empty() || !frame.displacement.allFinite())
        throw InvalidInput("'" + path.string() + "', frame " + std::to_string(frame.index) +
                           ": tissue that is there has no displacement; simulate the scene again");
    frame.mesh = std::move(part.mesh);
    frame.gone = part_of(whole, gone).mesh;
    return frame;
}

}  // namespace tissuewarp::simulation
