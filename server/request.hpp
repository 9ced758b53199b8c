#pragma once
/// What a client asks for in a STRING: JSON (docs/manual/serve.md).

#include "server/scene.hpp"

#include <filesystem>
#include <string>
#include <vector>

namespace tissuewarp::server {

struct Request {
    enum class Do { Update, Follow, Stop, Cancel, Gather, Pause, Forget, Info, Load, Save };
    Do what = Do::Info;
    long long sequence = 0;          ///< the client's number, which answers repeat
    std::vector<std::string> use;    ///< names of data; empty: everything
    std::vector<std::string> send;   ///< "warped", "field": beside organ and targets, to this client alone
    std::vector<std::string> names;  ///< to forget, to load as, to save, or whose transforms to gather
    std::vector<std::string> ids;    ///< of what was touched, to forget
    std::string file;                ///< of load and save, in the folder of the server
    Gathering gathering;             ///< of the first of `names`, or "stylus"
    Deviations deviations;
    int rounds = 8;
    double tolerance_mm = 0.05, fade_mm = 60;
    bool align = true, error_estimate = true;
    bool begin_anew = false;  ///< with the rigid placement, rather than where the last update ended
};

/// Throws InvalidInput, naming the key, its value and what it may be.
Request parse_request(const std::string& text);

/// What gather, pause and forget change; other requests change nothing. Throws InvalidInput.
void apply(const Request& request, Scene& scene);

/// The file in the folder that a request may touch. Throws InvalidInput without a folder, for a name with a path in it,
/// and for what is there and is no ordinary file: nothing outside the folder is opened.
std::filesystem::path file_in(const std::filesystem::path& folder, const std::string& name);

}  // namespace tissuewarp::server
