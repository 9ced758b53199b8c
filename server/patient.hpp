#pragma once
/// What a server serves: a patient as it was prepared.

#include "registration/update.hpp"
#include "server/messages.hpp"

#include <memory>
#include <string>

namespace tissuewarp::server {

struct ServedPatient {
    std::shared_ptr<const registration::PreparedModel> model;
    imaging::Volume image;               ///< preoperative, to be warped; or empty
    imaging::Volume labels;              ///< preoperative
    std::string digest;                  ///< of the patient's file
    registration::UpdateOptions update;  ///< device, and what requests do not change
};

}  // namespace tissuewarp::server
