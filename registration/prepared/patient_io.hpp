#pragma once
/// A patient in one file: the prepared model, and what a program needs beside it to tell of updates (docs/record.md).

#include "registration/prepare.hpp"

#include <filesystem>
#include <string>

namespace tissuewarp::registration {

struct Patient {
    PreparedModel prepared;
    imaging::Volume labels;  ///< the preoperative label map, rigid neighbours included
    imaging::Volume image;   ///< the preoperative grey image as it was given, or empty
    std::string facts;       ///< what the program that prepared keeps, in its own words; JSON of `tissuewarp prepare`
};

/// Writes what write_prepared does, `image` (one component, or empty) and `facts` to a temporary name and renames.
/// read_prepared reads such files too. Throws IoError, InvalidInput.
void write_patient(const PreparedModel& prepared, const imaging::Volume& image, const std::string& facts,
                   const std::filesystem::path& path);

/// Throws IoError, Cancelled, and InvalidInput where the file holds a prepared model alone.
Patient read_patient(const std::filesystem::path& path, Observer& observer = silent_observer());

}  // namespace tissuewarp::registration
