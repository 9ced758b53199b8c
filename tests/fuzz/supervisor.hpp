#pragma once
/// Cases in a process of their own, which may die, hang or eat memory without ending the run.

#include "tests/fuzz/format.hpp"

#include <cstdint>

namespace tissuewarp::fuzz {

/// Files of one case, given its number.
using CaseMaker = std::function<Seed(std::uint64_t number)>;

struct Failure {
    std::uint64_t number = 0;
    std::string problem;
};

struct Tally {
    std::uint64_t cases = 0, accepted = 0;
    std::vector<Failure> failures;
    double seconds = 0, slowest_seconds = 0;
    std::size_t largest_peak = 0;
};

/// Runs the cases from `first` to `last` (not itself) of a format. A case is good when its reader returns what stands
/// in the file, or throws InvalidInput or IoError with a message that names the file, within ten seconds and within ten
/// times the files' bytes and `floor_bytes` of memory. Files of failures are copied into `failures`.
Tally supervised(const Format& format, const std::function<CaseMaker(const std::vector<Seed>&)>& maker,
                 std::uint64_t first, std::uint64_t last, const std::filesystem::path& failures);

/// What a reader may take for files of any size: buffers of zlib (1 MiB), dictionaries of GDCM, the chunk cache of HDF5
/// and the scratch of parallel algorithms come to 1 MiB for the seeds; the rest lets a small file lie no worse than a
/// small image costs.
constexpr std::size_t floor_bytes = std::size_t{16} << 20;

}  // namespace tissuewarp::fuzz
