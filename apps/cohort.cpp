// tissuewarp cohort: hands a table of pairs to the workflow beside the program, which is Python and Snakemake.

#include "apps/verbs.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <unistd.h>
#include <cerrno>
#include <cstring>

namespace tissuewarp::apps {
namespace fs = std::filesystem;

namespace {

/// Of an installation, share/tissuewarp/workflow beside its bin; of a build, workflow/ of the sources above it.
fs::path workflow_of(const fs::path& program) {
    std::vector<fs::path> places{program.parent_path().parent_path() / "share" / "tissuewarp" / "workflow"};
    for (fs::path folder = program.parent_path(); folder != folder.root_path(); folder = folder.parent_path())
        places.push_back(folder / "workflow");
    for (const fs::path& place : places)
        if (fs::exists(place / "cohort.py")) return place;
    throw IoError(fmt::format("the workflow is not beside the program ('{}'); install the package as a whole",
                              places.front().string()));
}

std::vector<std::string> arguments_of(const CohortOptions& options) {
    std::vector<std::string> result{options.table.string(),
                                    "--output=" + options.output.string(),
                                    fmt::format("--jobs={}", options.jobs),
                                    fmt::format("--threads={}", options.common.threads),
                                    "--slurm=" + options.slurm,
                                    fmt::format("--devices={}", fmt::join(options.devices, ",")),
                                    fmt::format("--per-device={}", options.per_device),
                                    "--frame=" + options.frame};
    if (options.dry_run) result.emplace_back("--dry-run");
    if (options.common.quiet) result.emplace_back("--quiet");
    return result;
}

void require_devices(const std::vector<std::string>& devices) {
    for (const std::string& device : devices)
        if (!device.starts_with("gpu:"))
            throw InvalidInput("--devices '" + device +
                               "' is no GPU by its index; write for instance gpu:0,gpu:1 (see 'tissuewarp info "
                               "--devices')");
}

}  // namespace

void run_cohort(const CohortOptions& options) {
    require_devices(options.devices);
    if (options.table.string().starts_with("-")) throw InvalidInput("the table is missing; give a CSV table");
    const fs::path program = fs::read_symlink("/proc/self/exe");
    std::vector<std::string> words{"python3", "-s", (workflow_of(program) / "cohort.py").string(), program.string()};
    for (std::string& argument : arguments_of(options)) words.push_back(std::move(argument));
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    execvp(arguments.front(), arguments.data());
    throw IoError(fmt::format("python3 cannot be started ({}); install it, and snakemake", std::strerror(errno)));
}

}  // namespace tissuewarp::apps
