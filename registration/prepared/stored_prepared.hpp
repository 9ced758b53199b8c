#pragma once
/// The datasets of a prepared model, which patient files hold too (docs/record.md).

#include "core/detail/hdf5.hpp"
#include "registration/prepare.hpp"

#include <filesystem>

namespace tissuewarp::registration::detail {

/// Of files that hold a prepared model.
inline constexpr const char* prepared_format = "tissuewarp prepared model";
inline constexpr int prepared_version = 6, oldest_prepared_version = 1;

void write_prepared_parts(Hdf5Output& file, const PreparedModel& prepared);
/// Rest state and factor are made anew. `path` names the file in messages. Throws InvalidInput, Cancelled.
PreparedModel read_prepared_parts(const Hdf5Input& file, const std::filesystem::path& path, Observer& observer);

}  // namespace tissuewarp::registration::detail
