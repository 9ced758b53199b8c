// Gives damaged files to every reader of the program (README.md).

#include "tests/fuzz/mutations.hpp"
#include "tests/fuzz/supervisor.hpp"

#include <algorithm>
#include <charconv>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace {

using namespace tissuewarp::fuzz;
namespace fs = std::filesystem;

constexpr const char* usage =
    "fuzz_readers [--seed N] [--first N] [--count N] [--format NAME] [--failures FOLDER] [--replay CORPUS] [--list]\n"
    "  --format takes all formats whose names begin so; --replay reads the files of a corpus in place of new ones;\n"
    "  --first N --count 1 repeats one case\n";

struct Options {
    std::uint64_t seed = 1, first = 0, count = 1000;
    std::string format;
    fs::path failures = "fuzz-failures", replay;
    bool list = false;
};

std::uint64_t number(const char* text) {
    std::uint64_t value = 0;
    const auto [end, failure] = std::from_chars(text, text + std::strlen(text), value);
    if (failure != std::errc() || *end != '\0') throw std::invalid_argument(text);
    return value;
}

Options parsed(int argc, char** argv) {
    Options options;
    for (int i = 1; i < argc; ++i) {
        const std::string name = argv[i];
        if (name == "--list") {
            options.list = true;
            continue;
        }
        if (i + 1 >= argc) throw std::invalid_argument(name);
        const char* value = argv[++i];
        if (name == "--seed")
            options.seed = number(value);
        else if (name == "--first")
            options.first = number(value);
        else if (name == "--count")
            options.count = number(value);
        else if (name == "--format")
            options.format = value;
        else if (name == "--failures")
            options.failures = value;
        else if (name == "--replay")
            options.replay = value;
        else
            throw std::invalid_argument(name);
    }
    return options;
}

std::vector<Format> all_formats() {
    std::vector<Format> formats;
    for (const auto& some : {image_formats(), dicom_formats(), surface_formats(), mesh_formats(), point_formats(),
                             toml_formats(), transform_formats(), model_formats()})
        formats.insert(formats.end(), some.begin(), some.end());
    return formats;
}

/// One stream of numbers for each case, so that it can be repeated alone. Case 0 of each seed is left as it is.
Random random_of(std::uint64_t seed, std::uint64_t number) {
    std::seed_seq sequence{seed, seed >> 32, number, number >> 32};
    return Random(sequence);
}

/// Files that failed once: a folder each, in the folder of their format.
std::vector<fs::path> corpus_of(const fs::path& corpus, const std::string& format) {
    std::vector<fs::path> cases;
    if (fs::is_directory(corpus / format))
        for (const auto& entry : fs::directory_iterator(corpus / format)) cases.push_back(entry.path());
    std::sort(cases.begin(), cases.end());
    return cases;
}

Seed replayed(const fs::path& folder, const std::vector<Seed>& seeds) {
    Seed files;
    for (const auto& entry : fs::directory_iterator(folder))
        files.files[entry.path().filename()] = {bytes_at(entry.path()), "", Packing::None};
    for (const Seed& seed : seeds)
        if (files.files.contains(seed.named)) files.named = seed.named;
    return files;
}

Tally run(const Format& format, const Options& options) {
    if (!options.replay.empty()) {
        const std::vector<fs::path> cases = corpus_of(options.replay, format.name);
        Format unedited = format;
        unedited.edit = {};
        return supervised(
            unedited,
            [&](const std::vector<Seed>& seeds) {
                return [&cases, seeds](std::uint64_t number) { return replayed(cases[number], seeds); };
            },
            0, cases.size(), options.failures);
    }
    return supervised(
        format,
        [&](const std::vector<Seed>& seeds) {
            return [&options, &format, seeds](std::uint64_t number) {
                Random random = random_of(options.seed, number);
                Seed files = seeds[number < seeds.size() ? number : random() % seeds.size()];
                files.must_be_read = number < seeds.size();
                files.edited = !files.must_be_read && format.edit && random() % 2 == 0;
                return files.must_be_read || files.edited ? files : damaged(format, seeds, random);
            };
        },
        options.first, options.first + options.count, options.failures);
}

void print(const Format& format, const Tally& tally, const Options& options) {
    const double cases = static_cast<double>(std::max<std::uint64_t>(tally.cases, 1));
    std::printf(
        "%-18s %8llu cases, %5.1f %% accepted, %3zu failed, %7.2f s per 1000, slowest %.2f s, at most %zu MiB\n",
        format.name.c_str(), static_cast<unsigned long long>(tally.cases),
        100.0 * static_cast<double>(tally.accepted) / cases, tally.failures.size(), 1000.0 * tally.seconds / cases,
        tally.slowest_seconds, tally.largest_peak >> 20);
    for (const Failure& failure : tally.failures)
        std::printf("FAILED %s --seed %llu --first %llu: %s\n", format.name.c_str(),
                    static_cast<unsigned long long>(options.seed), static_cast<unsigned long long>(failure.number),
                    failure.problem.c_str());
    std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) try {
    const Options options = parsed(argc, argv);
    bool good = true, any = false;
    for (const Format& format : all_formats()) {
        if (!format.name.starts_with(options.format)) continue;
        any = true;
        if (options.list) {
            std::puts(format.name.c_str());
            continue;
        }
        const Tally tally = run(format, options);
        print(format, tally, options);
        good = good && tally.failures.empty();
    }
    if (!any) throw std::invalid_argument(options.format);
    return good ? 0 : 1;
} catch (const std::invalid_argument& error) {
    std::fprintf(stderr, "cannot use '%s'\n%s", error.what(), usage);
    return 2;
}
