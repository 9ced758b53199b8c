#pragma once
/// What is written into a log, and what follows from it again.

#include "server/computation.hpp"
#include "server/journal.hpp"

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <utility>

namespace tissuewarp::server {

/// Payloads of entries.
Bytes logged(const Frame& frame);
Bytes logged(const Job& job);
Bytes logged(const Job& job, const Products& products);

/// An update of what the scene holds now. Throws InvalidInput where it cannot be asked for.
Job job_of(const Scene& scene, const Request& request, const std::string& request_text);

/// What a session knew at an entry of its log.
struct Recalled {
    Scene scene;
    std::optional<std::pair<Request, std::string>> follow;  ///< and its text

    /// Takes in what clients sent; other entries change nothing. Throws InvalidInput.
    void take(const Entry& entry);
    /// The update that this entry began. Throws InvalidInput.
    [[nodiscard]] Job job(const Entry& entry) const;
};

/// Which updates of a log gave results, and which of them went on from the one before.
struct LoggedResults {
    struct Result {
        std::string digest;
        bool went_on = false;
    };
    std::map<long long, Result> of_update;
    /// Of the last one, and of the one that began anew from which it follows; 0 without any.
    long long last = 0, begin_of_last = 0;
};
/// Throws IoError, InvalidInput.
LoggedResults logged_results(const std::filesystem::path& log, const std::string& patient_digest);

/// Computes those updates again from the one of number `from` on, each from what the one before gave where it went on
/// from it. Calls `each` with the job and what it gave.
void compute_again(const ServedPatient& patient, const NamedPoints& targets, const std::filesystem::path& log,
                   const LoggedResults& results, long long from,
                   const std::function<void(const Job&, const std::shared_ptr<const Products>&)>& each);

/// Repeats every update of a log that gave a result. Calls `each` with its number and whether the bits are the same.
void replay(const ServedPatient& patient, const NamedPoints& targets, const std::filesystem::path& log,
            const std::function<void(long long number, bool same)>& each);

}  // namespace tissuewarp::server
