#pragma once
/// Results of a registration as DICOM objects, in the studies of its inputs.

#include "apps/register_run.hpp"

#include <filesystem>
#include <string>

namespace tissuewarp::apps {

/// Before any work: throws InvalidInput where a series that DICOM objects shall belong to has no frame of reference.
void require_dicom_origins(const RegisterOptions& options);

/// Writes registration.dcm, structures.dcm, uncertainty.dcm or jacobian.dcm, as `file` says, of a run whose --fixed or
/// --moving, as output_names.cpp knows, are DICOM. Throws IoError, or InvalidInput where they state no frame of
/// reference.
void write_dicom_result(const RegistrationRun& run, const std::string& file, const std::filesystem::path& path);

}  // namespace tissuewarp::apps
