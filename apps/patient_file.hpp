#pragma once
/// What `prepare` leaves to `update` and `serve` in a patient file.

#include "apps/inputs.hpp"
#include "registration/prepared/patient_io.hpp"

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace tissuewarp::apps {

/// A patient as it was prepared. Of `inputs` what is known before the operation is filled in, without the images that
/// matching takes, which the model holds.
struct PreparedPatient {
    RegistrationInputs inputs;
    std::unique_ptr<registration::PreparedModel> model;
    PreoperativeOptions options;
    std::vector<Parameter> parameters;
    bool for_labels = false;                        ///< the mesh is as fine as labels make use of
    std::map<std::string, std::string> provenance;  ///< when and by what it was made
};

/// Throws IoError.
void write_patient_file(const PrepareModelOptions& options, const RegistrationInputs& inputs,
                        const registration::PreparedModel& model, const std::string& started);

/// Throws IoError, InvalidInput, Cancelled.
PreparedPatient read_patient_file(const std::filesystem::path& path, Observer& observer);

}  // namespace tissuewarp::apps
