#pragma once
/// The datasets of a prepared model, which patient files hold too (docs/record.md).

#include "core/detail/hdf5.hpp"
#include "registration/prepare.hpp"

#include <filesystem>

namespace tissuewarp::registration::detail {

/// Of files that hold a prepared model.
inline constexpr const char* prepared_format = "tissuewarp prepared model";
inline constexpr int prepared_version = 8, oldest_prepared_version = 1;
/// The version to write: older programs would take what is gone for tissue, or join what slides, and read everything
/// else.
inline int version_of(const PreparedModel& prepared) {
    constexpr int of_whole_tissue = 6, of_resections = 7;
    if (!prepared.sliding.empty()) return prepared_version;
    return prepared.resected.empty() ? of_whole_tissue : of_resections;
}

void write_prepared_parts(Hdf5Output& file, const PreparedModel& prepared);
/// Rest state and factor are made anew. `path` names the file in messages. Throws InvalidInput, Cancelled.
PreparedModel read_prepared_parts(const Hdf5Input& file, const std::filesystem::path& path, Observer& observer);

}  // namespace tissuewarp::registration::detail
