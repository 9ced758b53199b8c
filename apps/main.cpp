// The program: picks the verb, turns exceptions into one line and an exit code.
//   0 done, 1 unexpected, 2 wrong input or usage, 3 file, 4 numerics, 5 no GPU, 130 interrupted

#include "apps/blas.hpp"
#include "apps/options.hpp"
#include "apps/progress.hpp"
#include "apps/threads.hpp"
#include "apps/verbs.hpp"
#include "core/errors.hpp"
#include "tled/blas_threads.hpp"

#include <spdlog/sinks/stdout_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <new>

namespace {

using namespace tissuewarp;

struct RunVerb {
    void operator()(const apps::RegisterOptions& options) const { apps::run_register(options); }
    void operator()(const apps::PrepareModelOptions& options) const { apps::run_prepare(options); }
    void operator()(const apps::UpdatePatientOptions& options) const { apps::run_update(options); }
    void operator()(const apps::ServeOptions& options) const { apps::run_serve(options); }
    void operator()(const apps::MeshOptions& options) const { apps::run_mesh(options); }
    void operator()(const apps::WarpOptions& options) const { apps::run_warp(options); }
    void operator()(const apps::ConvertOptions& options) const { apps::run_convert(options); }
    void operator()(const apps::CompoundOptions& options) const { apps::run_compound(options); }
    void operator()(const apps::EvaluateOptions& options) const { apps::run_evaluate(options); }
    void operator()(const apps::InfoOptions& options) const { apps::run_info(options); }
    void operator()(const apps::BenchOptions& options) const { apps::run_bench(options); }
    void operator()(const apps::SimulateOptions& options) const { apps::run_simulate(options); }
    void operator()(const apps::ExplainOptions& options) const { apps::run_explain(options); }
    void operator()(const apps::CalibrateOptions& options) const { apps::run_calibrate(options); }
    void operator()(const apps::StudyOptions& options) const { apps::run_study(options); }
    void operator()(const apps::CohortOptions& options) const { apps::run_cohort(options); }
};

/// The page that helps: the one that a message names, or that of the verb.
std::string with_page(const std::string& message, const std::string& verb) {
    if (message.find("docs/") != std::string::npos) return message;
    const std::string page = verb.empty() ? "index" : "manual/" + (verb == "update" ? std::string("prepare") : verb);
    return message + " (docs/" + page + ".md)";
}

int report(const std::vector<std::string>& arguments, int code, std::string message) {
    std::replace(message.begin(), message.end(), '\n', ' ');
    const std::string verb = apps::verb_of(arguments);
    if (code >= 2 && code <= 5) message = with_page(message, verb);  // refused or failed, not interrupted
    spdlog::error("tissuewarp{}{}: {}", verb.empty() ? "" : " ", verb, message);
    return code;
}

}  // namespace

int main(int argc, char** argv) {
    apps::start_again_if_blas_mistook_the_processor(argv);
    tled::let_solves_take_one_blas_thread(true);
    spdlog::set_default_logger(spdlog::stderr_logger_st("tissuewarp"));
    spdlog::set_pattern("%v");
    const std::vector<std::string> arguments(argv + 1, argv + argc);
    try {
        const apps::Command command = apps::parse_command_line(arguments);
        apps::catch_interrupts();
        const int asked = std::visit([](const auto& options) { return options.common.threads; }, command);
        const int threads = apps::usable_threads(asked);
        if (threads < asked) spdlog::warn("note: {} threads on {} processors; {} are used", asked, threads, threads);
        apps::with_threads(threads, [&] { std::visit(RunVerb{}, command); });
        if (std::fflush(stdout) != 0) throw IoError("cannot write to standard output");
        return 0;
    } catch (const apps::HelpRequest& help) {
        std::fputs(help.text.c_str(), stdout);
        return 0;
    } catch (const InvalidInput& error) {
        return report(arguments, 2, error.what());
    } catch (const IoError& error) {
        return report(arguments, 3, error.what());
    } catch (const SolverFailure& error) {
        return report(arguments, 4, error.what());
    } catch (const GpuUnavailable& error) {
        return report(arguments, 5, error.what());
    } catch (const apps::Interrupted& interrupted) {
        return report(arguments, 130, interrupted.what());
    } catch (const Cancelled&) {
        return report(arguments, 130, "interrupted; nothing was written");
    } catch (const apps::TooFewThreads& error) {
        return report(arguments, 1, error.what());
    } catch (const std::bad_alloc&) {
        return report(arguments, 1, "not enough memory; use a coarser --edge-length or smaller images");
    } catch (const std::exception& error) {
        return report(arguments, 1, std::string("unexpected: ") + error.what());
    }
}
