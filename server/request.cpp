#include "server/request.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

namespace tissuewarp::server {

namespace {

using nlohmann::json;

constexpr std::array<std::pair<const char*, Request::Do>, 10> verbs{{{"update", Request::Do::Update},
                                                                     {"follow", Request::Do::Follow},
                                                                     {"stop", Request::Do::Stop},
                                                                     {"cancel", Request::Do::Cancel},
                                                                     {"gather", Request::Do::Gather},
                                                                     {"pause", Request::Do::Pause},
                                                                     {"forget", Request::Do::Forget},
                                                                     {"info", Request::Do::Info},
                                                                     {"load", Request::Do::Load},
                                                                     {"save", Request::Do::Save}}};

[[noreturn]] void refuse(const std::string& key, const json& value, const std::string& wanted) {
    throw InvalidInput("\"" + key + "\" is " + value.dump(-1, ' ', true, json::error_handler_t::replace) +
                       "; it may be " + wanted);
}

Request::Do verb_of(const json& value) {
    for (const auto& [name, what] : verbs)
        if (value == name) return what;
    refuse("do", value, "update, follow, stop, cancel, gather, pause, forget, info, load or save");
}

double number(const std::string& key, const json& value, double least, double most) {
    if (value.is_number() && value >= least && value <= most) return value.get<double>();
    refuse(key, value, "a number from " + json(least).dump() + " to " + json(most).dump());
}

bool truth(const std::string& key, const json& value) {
    if (value.is_boolean()) return value.get<bool>();
    refuse(key, value, "true or false");
}

std::string text(const std::string& key, const json& value) {
    constexpr std::size_t most = 200;
    if (value.is_string() && value.get_ref<const std::string&>().size() <= most) return value.get<std::string>();
    refuse(key, value, "a text of at most 200 bytes");
}

std::vector<std::string> texts(const std::string& key, const json& value) {
    constexpr std::size_t most = 32;
    if (!value.is_array() || value.size() > most) refuse(key, value, "a list of at most 32 names");
    std::vector<std::string> result;
    for (const json& entry : value) result.push_back(plain_name(text(key, entry)));
    return result;
}

std::vector<std::string> sent(const std::string& key, const json& value) {
    std::vector<std::string> result = texts(key, value);
    for (const std::string& name : result)
        if (name != "warped" && name != "field") refuse(key, name, "warped and field");
    return result;
}

/// As they are, since they name points and not devices.
std::vector<std::string> ids(const std::string& key, const json& value) {
    constexpr std::size_t most = 1000;
    if (!value.is_array() || value.size() > most) refuse(key, value, "a list of at most 1000 ids");
    std::vector<std::string> result;
    for (const json& entry : value) result.push_back(text(key, entry));
    return result;
}

void take_option(Request& request, const std::string& key, const json& value) {
    if (key == "surface_sd_mm")
        request.deviations.surface_mm = number(key, value, 1e-3, 100);
    else if (key == "points_sd_mm")
        request.deviations.points_mm = number(key, value, 1e-3, 100);
    else if (key == "curves_sd_mm")
        request.deviations.curves_mm = number(key, value, 1e-3, 100);
    else if (key == "rounds")
        request.rounds = static_cast<int>(number(key, value, 1, 1000));
    else if (key == "tolerance_mm")
        request.tolerance_mm = number(key, value, 1e-6, 10);
    else if (key == "fade_mm")
        request.fade_mm = number(key, value, 1, 1e4);
    else if (key == "align")
        request.align = truth(key, value);
    else if (key == "error_estimate")
        request.error_estimate = truth(key, value);
    else if (key == "begin_anew")
        request.begin_anew = truth(key, value);
    else if (key == "id")
        request.gathering.id = text(key, value);
    else if (key == "spacing_mm")
        request.gathering.spacing_mm = number(key, value, 0.1, 50);
    else if (key == "keep_s")
        request.gathering.keep_s = number(key, value, 0, 1e5);
    else
        throw InvalidInput("there is no \"" + key.substr(0, 60) +
                           "\" in a request; keys are do, sequence, use, send, names, ids, file, surface_sd_mm, "
                           "points_sd_mm, curves_sd_mm, rounds, tolerance_mm, fade_mm, align, error_estimate, "
                           "begin_anew, id, spacing_mm and keep_s");
}

/// Nested without end it would take the stack of whoever frees it.
json parsed(const std::string& text) {
    constexpr int deepest = 4;
    const auto flat = [](int depth, json::parse_event_t, json&) {
        if (depth > deepest) throw InvalidInput("a request is nested more than 4 deep");
        return true;
    };
    try {
        return json::parse(text, flat);
    } catch (const json::exception& problem) {
        throw InvalidInput(std::string("a request is no JSON: ") + problem.what());
    }
}

}  // namespace

Request parse_request(const std::string& given) {
    const json object = parsed(given);
    if (!object.is_object()) throw InvalidInput("a request is no JSON object; write {\"do\": \"update\"}");
    if (!object.contains("do")) throw InvalidInput("a request says nothing to do; write {\"do\": \"update\"}");
    Request request;
    for (const auto& [key, value] : object.items()) {
        if (key == "do")
            request.what = verb_of(value);
        else if (key == "sequence")
            request.sequence = static_cast<long long>(number(key, value, 0, 9e15));
        else if (key == "use")
            request.use = texts(key, value);
        else if (key == "names")
            request.names = texts(key, value);
        else if (key == "ids")
            request.ids = ids(key, value);
        else if (key == "send")
            request.send = sent(key, value);
        else if (key == "file")
            request.file = text(key, value);
        else
            take_option(request, key, value);
    }
    request.gathering.device = request.names.empty() ? "stylus" : request.names.front();
    return request;
}

void apply(const Request& request, Scene& scene) {
    switch (request.what) {
        case Request::Do::Gather:
            return scene.gather(request.gathering);
        case Request::Do::Pause:
            return scene.gather({});
        case Request::Do::Forget:
            if (!request.ids.empty() && !request.names.empty())
                throw InvalidInput(
                    "\"ids\" are of single touches and \"names\" of all that have a name; give one of them");
            if (!request.ids.empty()) scene.forget_touched(request.ids);
            for (const std::string& name : request.names) scene.forget(name);
            return;
        default:
            return;
    }
}

std::filesystem::path file_in(const std::filesystem::path& folder, const std::string& name) {
    namespace fs = std::filesystem;
    if (folder.empty()) throw InvalidInput("this server reads and writes no files; start it with --folder");
    const bool plain = !name.empty() && name.front() != '.' &&
                       std::all_of(name.begin(), name.end(), [](unsigned char c) { return c > 0x20 && c < 0x7f; }) &&
                       name.find_first_of("/\\") == std::string::npos;
    if (!plain) throw InvalidInput("'" + name + "' is no plain name of a file in the server's folder");
    const fs::path path = folder / name;
    const fs::file_status status = fs::symlink_status(path);
    if (fs::exists(status) && !fs::is_regular_file(status))
        throw InvalidInput("'" + name + "' is no ordinary file of the server's folder");
    return path;
}

}  // namespace tissuewarp::server
