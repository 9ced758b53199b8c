#pragma once
/// Does the dial keep what it is asked for? Phantoms that its figures do not come from are registered with a time
/// budget and with an accuracy.

#include "core/observer.hpp"
#include "registration/dial/dial.hpp"
#include "registration/update.hpp"

#include <cstdint>
#include <filesystem>
#include <vector>

namespace tissuewarp::study {

struct DialTrialOptions {
    std::uint64_t first_seed = 7001, last_seed = 7050;  ///< of random_phantom
    std::vector<double> budgets_s{1.0, 2.0};
    std::vector<double> accuracies_mm{1.0, 2.0, 4.0};
    registration::UpdateOptions update;
};

/// One registration under a request.
struct DialTrial {
    std::uint64_t seed = 0;
    registration::DataKind kind = registration::DataKind::Labels;
    registration::DialRequest request;
    double edge_length_mm = 0;
    double expected_s = 0, seconds = 0;     ///< from data at hand to warped image
    double error_mm = 0, estimated_mm = 0;  ///< root mean square: over the targets, and over the tissue
    bool announced = false;                 ///< before or after the registration: what was asked for is not given
    bool possible = true;                   ///< by the figures, before it

    [[nodiscard]] bool kept_time() const { return !request.time_s || seconds <= 1.1 * *request.time_s; }
    [[nodiscard]] bool kept_accuracy() const { return !request.accuracy_mm || error_mm <= *request.accuracy_mm; }
};

/// With labels, and with a part of the surface and pairs of points. Each phantom's trials are kept in
/// `folder`/dial_<seed>.csv, which appear complete or not at all; phantoms whose file is there are read, not tried.
/// Phantoms that fail are noted and left out. Throws InvalidInput for requests that cannot be or a file that is not
/// such a table, IoError, Cancelled.
std::vector<DialTrial> try_dial(const std::filesystem::path& folder, const registration::Fronts& fronts,
                                const DialTrialOptions& options, Observer& observer = silent_observer());

/// CSV with a header: lengths mm, times s, an empty field where nothing was asked. Throw IoError, InvalidInput.
void write_dial_trials(const std::filesystem::path& path, const std::vector<DialTrial>& trials);
std::vector<DialTrial> read_dial_trials(const std::filesystem::path& path);

}  // namespace tissuewarp::study
