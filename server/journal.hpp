#pragma once
/// The log of a server: what it took in, which updates it began and what they gave, in this order. It replays a session
/// bit by bit, and a server that was killed goes on from it.

#include "server/wire.hpp"

#include <filesystem>
#include <functional>
#include <mutex>
#include <string>

namespace tissuewarp::server {

/// One entry. The payload of a message that was taken in is header and body as they came, those of updates are JSON.
struct Entry {
    enum class Kind : unsigned char { Taken = 'M', Update = 'U', Result = 'R' };
    Kind kind = Kind::Taken;
    std::uint32_t client = 0;
    Bytes payload;
};

class Journal {
public:
    /// Opens the log of this patient, or begins one. What a killed process left half-written at its end is cut off.
    /// Throws IoError; InvalidInput for a file that is no log, or is of another patient.
    Journal(std::filesystem::path path, std::string patient_digest);
    ~Journal();
    Journal(const Journal&) = delete;
    Journal& operator=(const Journal&) = delete;

    /// On disk, for the system's part, when it returns. Throws IoError.
    void append(Entry::Kind kind, std::uint32_t client, ByteView payload);

private:
    std::filesystem::path path_;
    int file_ = -1;
    std::mutex mutex_;
};

/// Calls `each` for every whole entry of the log, in order. Throws IoError, InvalidInput as the constructor.
void read_journal(const std::filesystem::path& path, const std::string& patient_digest,
                  const std::function<void(const Entry&)>& each);

}  // namespace tissuewarp::server
