#pragma once
/// The parts that prepared models and records have in common, in HDF5 (docs/record.md).

#include "core/detail/hdf5.hpp"
#include "imaging/geometry.hpp"
#include "imaging/volume.hpp"
#include "registration/stage_time.hpp"
#include "tled/model.hpp"

namespace tissuewarp::registration::detail {

/// A group with nodes, tetrahedra, labels.
void write_mesh(Hdf5Output& file, const std::string& group, const meshing::TetMesh& mesh);
/// Not checked.
meshing::TetMesh read_mesh(const Hdf5Input& file, const std::string& group);

/// Groups /mesh, /materials, and /element, /density.
void write_model(Hdf5Output& file, const tled::Model& model);
/// Throws InvalidInput when the model is not valid (tled::require_valid).
tled::Model read_model(const Hdf5Input& file);

/// A group with size, origin, spacing, direction.
void write_grid(Hdf5Output& file, const std::string& group, const imaging::Geometry& grid);
imaging::Geometry read_grid(const Hdf5Input& file, const std::string& group);

/// Of a dataset of voxels: x runs fastest.
std::vector<hsize_t> voxel_shape(const imaging::Geometry& grid);
/// A group with the grid and voxels (int32) of a label map.
void write_label_map(Hdf5Output& file, const std::string& group, const imaging::Volume& labels);
imaging::Volume read_label_map(const Hdf5Input& file, const std::string& group);

/// Groups with one row per material: label, law, parameters.
void write_materials(Hdf5Output& file, const std::string& group, const tled::MaterialTable& materials);
tled::MaterialTable read_materials(const Hdf5Input& file, const std::string& group);

/// Columns as one dataset each.
void write_stages(Hdf5Output& file, const std::string& group, const std::vector<StageTime>& times);

}  // namespace tissuewarp::registration::detail
