#pragma once
/// Files of a registration that other programs show: maps, the organ with its errors, points with theirs.

#include "apps/register_run.hpp"

#include <filesystem>

namespace tissuewarp::apps {

/// ‖v‖ of each vector of a field of three float32 components, float32.
imaging::Volume magnitude(const imaging::Volume& field);

/// The organ's surface where it was carried to (fixed frame) as .vtp; on its nodes `deviation_mm`, `interval_95_mm` and
/// `trust`, where there is an estimate, and `displacement_mm`: how far each went. Throws IoError.
void write_organ(const RegistrationRun& run, const std::filesystem::path& path);

/// Carried landmarks, and points, as .mrk.json of 3D Slicer, numbered in the order of their inputs; their descriptions
/// say what is estimated of their errors and, of landmarks, how far they lie from where they belong. Throws IoError.
void write_landmark_markups(const RegistrationRun& run, const std::filesystem::path& path);
void write_point_markups(const RegistrationRun& run, const std::filesystem::path& path);

}  // namespace tissuewarp::apps
