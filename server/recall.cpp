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

json object_of(const Entry& entry) {
    try {
        return json::parse(entry.payload);
    } catch (const json::exception& problem) {
        throw InvalidInput(std::string("an entry of the log is none: ") + problem.what());
    }
}

/// The number of an update, and the text of this key.
std::pair<long long, std::string> words_of(const json& object, const char* key) {
    try {
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
    return bytes_of({{"update", job.number},
                     {"digest", products.digest},
                     {"began", products.result.beginning.at_last ? "last" : "anew"}});
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
    if (!text) return scene.take(frame.header.device, message, seconds_of(frame.header));
    const Request request = parse_request(text->text);
    if (request.what == Request::Do::Follow) follow = {request, text->text};
    if (request.what == Request::Do::Stop) follow.reset();
    apply(request, scene);
}

Job Recalled::job(const Entry& entry) const {
    const auto [number, text] = words_of(object_of(entry), "request");
    Job job = job_of(scene, parse_request(text), text);
    job.number = number;
    job.request.send.clear();  // nobody is there to whom it could be sent
    return job;
}

LoggedResults logged_results(const std::filesystem::path& log, const std::string& patient_digest) {
    LoggedResults results;
    read_journal(log, patient_digest, [&](const Entry& entry) {
        if (entry.kind != Entry::Kind::Result) return;
        const json object = object_of(entry);
        const auto [number, digest] = words_of(object, "digest");
        const bool went_on = object.value("began", "anew") == "last";
        results.of_update[number] = {digest, went_on};
        results.last = number;
        if (!went_on) results.begin_of_last = number;
    });
    return results;
}

void compute_again(const ServedPatient& patient, const NamedPoints& targets, const std::filesystem::path& log,
                   const LoggedResults& results, long long from,
                   const std::function<void(const Job&, const std::shared_ptr<const Products>&)>& each) {
    Recalled recalled;
    recalled.scene.set_targets(targets);
    Computer computer(patient);
    std::shared_ptr<const Products> last;
    read_journal(log, patient.digest, [&](const Entry& entry) {
        recalled.take(entry);
        if (entry.kind != Entry::Kind::Update) return;
        const Job job = recalled.job(entry);
        const auto result = results.of_update.find(job.number);  // none: it was cancelled, or gave no result
        if (job.number < from || result == results.of_update.end()) return;
        const Products* before = result->second.went_on ? last.get() : nullptr;
        last = std::make_shared<const Products>(computer.compute(job, before, silent_observer()));
        each(job, last);
    });
}

void replay(const ServedPatient& patient, const NamedPoints& targets, const std::filesystem::path& log,
            const std::function<void(long long, bool)>& each) {
    const LoggedResults results = logged_results(log, patient.digest);
    compute_again(patient, targets, log, results, 0, [&](const Job& job, const auto& products) {
        each(job.number, products->digest == results.of_update.at(job.number).digest);
    });
}

}  // namespace tissuewarp::server
