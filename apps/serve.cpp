// tissuewarp serve: a prepared patient over OpenIGTLink, until it is interrupted.

#include "apps/patient_file.hpp"
#include "apps/point_files.hpp"
#include "apps/progress.hpp"
#include "apps/update_device.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"
#include "core/sha256.hpp"
#include "registration/tissues.hpp"
#include "server/hub.hpp"
#include "server/recall.hpp"

#include <fmt/format.h>

#include <cstdio>

namespace tissuewarp::apps {

namespace {

server::ServedPatient served(const ServeOptions& options, Observer& observer) {
    PreparedPatient read = read_patient_file(options.patient, observer);
    const registration::Tissue& tissue = registration::tissue_named(read.options.tissue);
    if (tissue.free_stretch > 0)
        observer.note("the server does not stretch the organ as a whole, as register and update do for '" +
                      read.options.tissue + "'; take these where its volume changes by much");
    registration::UpdateOptions update = on_device(options.device);
    registration::expect_motion_of(tissue, update);
    return {std::move(read.model), std::move(read.inputs.moving), std::move(read.inputs.moving_labels),
            sha256_of_file(options.patient), update};
}

server::NamedPoints targets(const ServeOptions& options, Observer& observer) {
    server::NamedPoints result;
    if (options.targets.empty()) return result;
    const Eigen::Matrix3Xd points = read_points(options.targets, observer);
    for (Eigen::Index p = 0; p < points.cols(); ++p)
        result.push_back({fmt::format("target {}", p + 1), "", points.col(p)});
    return result;
}

void say(const std::string& text) {
    fmt::print("{}\n", text);
    std::fflush(stdout);
}

void replay_log(const ServeOptions& options, ProgressLine& progress) {
    int updates = 0, others = 0;
    server::replay(served(options, progress), targets(options, progress), options.replay,
                   [&](long long number, bool same) {
                       ++updates;
                       others += !same;
                       if (!same) say(fmt::format("update {}: other bits", number));
                   });
    const std::string text =
        fmt::format("{} updates of '{}' computed again, {} with other bits", updates, options.replay.string(), others);
    if (others > 0) throw SolverFailure(text);
    say(text);
}

}  // namespace

void run_serve(const ServeOptions& options) {
    ProgressLine progress(options.common);
    if (!options.replay.empty()) return replay_log(options, progress);
    std::error_code none;
    if (!options.folder.empty() && !std::filesystem::is_directory(options.folder, none))
        throw IoError(fmt::format("--folder '{}' is no folder", options.folder.string()));
    progress.begin("reading the patient", 0, 1);
    server::ServedPatient patient = served(options, progress);
    const server::NamedPoints carried = targets(options, progress);
    progress.clear();
    const auto note = [&](const std::string& text) {
        if (!options.common.quiet) say(text);
    };
    for (const std::string& text : progress.notes()) note("note: " + text);
    server::Hub hub({options.address, options.port, {}}, note);
    server::Session session(std::move(patient), {options.folder, options.log, carried}, hub);
    say(fmt::format("serving '{}' on {} port {}", options.patient.string(), options.address, hub.port()));
    if (options.address != "127.0.0.1" && options.address != "::1")
        say("note: whoever reaches this address may send and read; nobody is asked who they are, nothing is encrypted");
    hub.run(session, interrupted);
}

}  // namespace tissuewarp::apps
