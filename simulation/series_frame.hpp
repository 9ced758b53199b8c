#pragma once
/// One frame of displacement.h5, for what carries other things along with a scene.

#include "meshing/tet_mesh.hpp"

#include <filesystem>

namespace tissuewarp::simulation {

/// The tissue at rest, by whether it is still there in the frame. Nodes count anew in each mesh.
struct SeriesFrame {
    int index = 0;
    double time = 0;                ///< s
    meshing::TetMesh mesh;          ///< what is there
    Eigen::Matrix3Xd displacement;  ///< of its nodes, 3 × N, mm
    meshing::TetMesh gone;          ///< what was taken out before; without tetrahedra where nothing was
};

/// A frame of the file that SeriesWriter left; `index` -1 is the last one. Throws IoError, and InvalidInput for
/// another format, for a frame that the file does not hold, and where its parts contradict each other.
SeriesFrame read_frame(const std::filesystem::path& path, int index = -1);

}  // namespace tissuewarp::simulation
