#pragma once
/// The record of a run: everything that is needed to apply, judge and repeat a registration, in one HDF5 file whose
/// layout is in docs/record.md.

#include "registration/prepare.hpp"
#include "registration/result.hpp"

#include <filesystem>
#include <map>
#include <string>

namespace tissuewarp::registration {

/// What the program knows and the libraries do not.
struct RecordInfo {
    std::map<std::string, std::string> provenance;  ///< SHA-256 of the inputs, versions, device, seeds, by name
    std::string parameters_toml;                    ///< the parameters used, as --save-parameters writes them
};

/// Writes to a temporary name and renames. Throws IoError, and InvalidInput when the result does not belong to the
/// prepared model or is not finite.
void write_record(const PreparedModel& prepared, const UpdateResult& result, const RecordInfo& info,
                  const std::filesystem::path& path);

/// What is needed to apply the deformation to further images, points and meshes.
struct Record {
    int format_version = 0;
    Deformation deformation;
    std::map<int, tled::Material> materials;
    tled::Element element = tled::Element::AveragedPressureT4;
    Eigen::VectorXd jacobian;       ///< det F of every tetrahedron
    imaging::Geometry moving_grid;  ///< of the preoperative label map
    imaging::Volume resected;       ///< labels of tissue that is gone, int32, moving frame; empty where none is
    std::map<std::string, std::string> provenance;
    std::string parameters_toml;
};

/// Throws IoError when the file cannot be read or is damaged, InvalidInput when it is no record of this format version
/// or its parts contradict each other (sizes, node indices, non-finite values, a placement that is not rigid).
Record read_record(const std::filesystem::path& path);

}  // namespace tissuewarp::registration
