#include "server/answers.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <cmath>

namespace tissuewarp::server {

namespace {

using nlohmann::json;

json number(double value) {
    return std::isfinite(value) ? json(value) : json(nullptr);
}

std::string dumped(const json& object) {
    return object.dump(-1, ' ', true, json::error_handler_t::replace);
}

json doubts_of(const registration::UpdateResult& result) {
    json list = json::array();
    for (const registration::Doubt& doubt : result.doubts)
        list.push_back({{"code", doubt.code},
                        {"severity", name_of(doubt.severity)},
                        {"text", doubt.text},
                        {"remedy", doubt.remedy}});
    return list;
}

std::string codes_of(const registration::UpdateResult& result) {
    std::string codes;
    for (const registration::Doubt& doubt : result.doubts)
        if (doubt.severity == registration::Severity::Doubt) codes += (codes.empty() ? "" : ", ") + doubt.code;
    return codes;
}

constexpr int status_ok = 1, status_error = 2;

}  // namespace

std::string answer(const Job& job, const Products& products, long long sequence, long long newest_state,
                   const std::vector<std::string>& notes) {
    const registration::Beginning& beginning = products.result.beginning;
    json object{{"do", job.follows ? "follow" : "update"},
                {"sequence", sequence},
                {"status", products.doubted() ? "doubted" : "ok"},
                {"update", job.number},
                {"time", products.time_s},
                {"state", job.state},
                {"newest_state", newest_state},
                {"outdated", newest_state > job.state},
                {"began", {{"at_last", beginning.at_last}, {"why_not", beginning.why}}},
                {"doubts", doubts_of(products.result)},
                {"device", products.result.engine},
                {"digest", products.digest},
                {"seconds", {{"total", products.seconds}}},
                {"notes", notes}};
    for (const auto& [stage, seconds] : products.result.times) object["seconds"][stage] = seconds;
    if (products.uncertainty) {
        const registration::UncertaintySummary summary = summarise(*products.uncertainty);
        object["error_mm"] = {{"deviation", number(summary.deviation_mm)},
                              {"interval_95", number(summary.interval_mm)},
                              {"worst_interval_95", number(summary.worst_interval_mm)}};
        object["unknown_share"] = number(summary.unknown_share);
        if (const auto& held_out = products.uncertainty->held_out())
            object["held_out"] = {{"z", number(held_out->z)}, {"regions", held_out->regions}};
    }
    return dumped(object);
}

std::string answer(const Request& request, const std::string& status, const std::string& why) {
    return dumped({{"sequence", request.sequence}, {"status", status}, {"why", why}});
}

Status status_of(const Job& job, const Products& products, long long newest_state) {
    const std::string age = newest_state > job.state ? fmt::format("state {} of {}, outdated", job.state, newest_state)
                                                     : fmt::format("state {}", job.state);
    if (products.doubted()) return {status_error, "doubted", age + ": do not trust it: " + codes_of(products.result)};
    return {status_ok, "", age};
}

Status status_of_failure(const Job& job, const std::string& why) {
    return {status_error, "no result", fmt::format("state {} gave none, what is shown is older: {}", job.state, why)};
}

Parcel parcel(const std::string& key, std::string_view type, std::string_view device, const Bytes& body,
              double time_s) {
    return {key, {std::make_shared<const Bytes>(framed(type, device, body, timestamp_of(time_s)))}};
}

Parcel shown(const Status& status, double time_s) {
    return parcel("status", "STATUS", device_name, encode(status), time_s);
}

Parcel said(const std::string& text, double time_s) {
    return parcel("", "STRING", device_name, encode(Text{text}), time_s);
}

}  // namespace tissuewarp::server
