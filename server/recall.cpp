#include "server/recall.hpp"

#include <nlohmann/json.hpp>

#include <map>

namespace tissuewarp::server {

namespace {

using nlohmann::json;

Bytes bytes_of(const json& words) {
    const std::string text = words.dump(-1, ' ', true, json::error_handler_t::replace);
    return {text.begin(), text.end()};
}

/// Whole, whatever limits it came by.
Frame frame_of(ByteView bytes) {
    const Limits limits{.text_bytes = 1 << 17};
    if (bytes.size() < header_bytes) throw InvalidInput("an entry of the log is no message");
    const ByteView body = bytes.subspan(header_bytes);
    return {parse_header(bytes.first(header_bytes), limits), {body.begin(), body.end()}};
}

/// The number of an update, and the text of this key.
std::pair<long long, std::string> words_of(const Entry& entry, const char* key) {
    try {
        const json object = json::parse(entry.payload);
        return {object.at("update").get<long long>(), object.at(key).get<std::string>()};
    } catch (const json::exception& problem) {
        throw InvalidInput(std::string("an entry of the log is none: ") + problem.what());
    }
}

}  // namespace

Bytes logged(const Frame& frame) {
    const Header& header = frame.header;
    return framed(header.type, header.device, content_of(header, frame.body), header.timestamp);
}

Bytes logged(const Job& job) {
    return bytes_of({{"update", job.number}, {"state", job.state}, {"request", job.request_text}});
}

Bytes logged(const Job& job, const Products& products) {
    return bytes_of({{"update", job.number}, {"digest", products.digest}});
}

Job job_of(const Scene& scene, const Request& request, const std::string& request_text) {
    Job job;
    job.state = scene.state();
    job.request = request;
    job.request_text = request_text;
    job.seen = scene.seen(request.use, request.deviations);
    job.targets = scene.targets();
    if (scene.grid()) job.grid = *scene.grid();
    return job;
}

void Recalled::take(const Entry& entry) {
    if (entry.kind != Entry::Kind::Taken) return;
    const Frame frame = frame_of(entry.payload);
    const Message message = decode(frame);
    const auto* text = std::get_if<Text>(&message);
    if (!text) return scene.take(frame.header.device, message);
    const Request request = parse_request(text->text);
    if (request.what == Request::Do::Follow) follow = {request, text->text};
    if (request.what == Request::Do::Stop) follow.reset();
    if (request.what != Request::Do::Forget) return;
    for (const std::string& name : request.names) scene.forget(name);
}

Job Recalled::job(const Entry& entry) const {
    const auto [number, text] = words_of(entry, "request");
    Job job = job_of(scene, parse_request(text), text);
    job.number = number;
    job.request.send.clear();  // nobody is there to whom it could be sent
    return job;
}

void replay(const ServedPatient& patient, NamedPoints targets, const std::filesystem::path& log,
            const std::function<void(long long, bool)>& each) {
    std::map<long long, std::string> digests;
    read_journal(log, patient.digest, [&](const Entry& entry) {
        if (entry.kind == Entry::Kind::Result) digests.insert(words_of(entry, "digest"));
    });
    Recalled recalled;
    recalled.scene.set_targets(std::move(targets));
    Computer computer(patient);
    read_journal(log, patient.digest, [&](const Entry& entry) {
        recalled.take(entry);
        if (entry.kind != Entry::Kind::Update) return;
        const Job job = recalled.job(entry);
        const auto digest = digests.find(job.number);  // none: it was cancelled, or gave no result
        if (digest != digests.end())
            each(job.number, computer.compute(job, silent_observer()).digest == digest->second);
    });
}

}  // namespace tissuewarp::server
