#pragma once
/// What is said of an update, and of requests that come to nothing: JSON in a STRING, and a STATUS.

#include "server/computation.hpp"
#include "server/outgoing.hpp"

#include <string>

namespace tissuewarp::server {

/// The device that the server is in its messages.
inline constexpr const char* device_name = "tissuewarp";

/// Of an update that gave a result. `newest_state` is that of the scene when it is sent: a greater one than the job's
/// says that newer data are on the way into the next. `sequence`: that of the request for whoever asked, 0 for others,
/// who count for themselves.
std::string answer(const Job& job, const Products& products, long long sequence, long long newest_state,
                   const std::vector<std::string>& notes);
/// Of one that gave none: "failed", "cancelled", "superseded" or "refused", and why.
std::string answer(const Request& request, const std::string& status, const std::string& why);

Status status_of(const Job& job, const Products& products, long long newest_state);
/// Of an update without a result: what was shown before is shown still, and is of an older state.
Status status_of_failure(const Job& job, const std::string& why);

/// Messages as they are sent; a key as Parcel's. All of one update have its time, which its answer names.
Parcel parcel(const std::string& key, std::string_view type, std::string_view device, const Bytes& body, double time_s);
Parcel shown(const Status& status, double time_s = now_s());
Parcel said(const std::string& text, double time_s = now_s());

}  // namespace tissuewarp::server
