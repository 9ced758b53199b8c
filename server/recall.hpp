#pragma once
/// What is written into a log, and what follows from it again.

#include "server/computation.hpp"
#include "server/journal.hpp"

#include <functional>
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

/// Repeats every update of a log that gave a result. Calls `each` with its number and whether the bits are the same.
void replay(const ServedPatient& patient, NamedPoints targets, const std::filesystem::path& log,
            const std::function<void(long long number, bool same)>& each);

}  // namespace tissuewarp::server
