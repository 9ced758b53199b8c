#include "tests/fuzz/supervisor.hpp"

#include "core/errors.hpp"
#include "tests/fuzz/allocations.hpp"
#include "tests/support/temporary_folder.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fstream>
#include <new>
#include <thread>
#include <typeinfo>

namespace tissuewarp::fuzz {

namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

constexpr double most_seconds = 10;
constexpr std::size_t longest_message = 4000;
constexpr std::size_t enough_failures = 40;

/// What both processes see.
struct Shared {
    std::atomic<std::uint64_t> number{0}, cases{0}, accepted{0};
    std::atomic<std::int64_t> started_ns{0};  ///< 0 between cases
    std::atomic<std::size_t> largest_peak{0};
    std::atomic<double> slowest{0};
    std::array<char, 2000> problem{};

    void tell(const std::string& text) {
        std::copy_n(text.begin(), std::min(text.size(), problem.size() - 1), problem.begin());
    }
};

std::int64_t now_ns() {
    return std::chrono::nanoseconds(Clock::now().time_since_epoch()).count();
}

/// What a reading came to.
struct Reading {
    std::string problem, message;  ///< problem empty: good
    bool accepted = false;
    Digest digest;
};

std::size_t size_of(const fs::path& folder) {
    std::size_t bytes = 0;
    for (const auto& entry : fs::directory_iterator(folder)) bytes += entry.file_size();
    return bytes;
}

bool names_the_file(const std::string& message, const fs::path& folder) {
    if (message.find(folder.string()) != std::string::npos) return true;
    for (const auto& entry : fs::directory_iterator(folder))
        if (message.find(entry.path().filename().string()) != std::string::npos) return true;
    return false;
}

std::string problem_of_message(const std::string& message, const fs::path& folder) {
    if (!names_the_file(message, folder)) return "the message does not name the file: " + message.substr(0, 300);
    if (message.size() > longest_message) return "a message of " + std::to_string(message.size()) + " characters";
    return "";
}

Reading reading(const Format& format, const fs::path& path, const fs::path& folder, unsigned char pattern) {
    Reading result;
    const std::size_t most = 10 * size_of(folder) + floor_bytes;
    std::string& message = result.message;
    watch_allocations(most, pattern);
    try {
        format.read(path, result.digest);
        result.accepted = true;
    } catch (const InvalidInput& error) {
        message = error.what();
    } catch (const IoError& error) {
        message = error.what();
    } catch (const std::exception& error) {
        result.problem = std::string("throws ") + typeid(error).name() + ": " + error.what();
    } catch (...) {
        result.problem = "throws what is no exception";
    }
    stop_watching();
    const std::size_t refused = refused_bytes(), peak = std::max(peak_bytes(), refused);
    if (result.problem.empty() && !result.accepted) result.problem = problem_of_message(message, folder);
    if (peak > most)
        result.problem = "takes " + std::to_string(peak >> 20) + " MiB for files of " +
                         std::to_string(size_of(folder)) + " bytes (" +
                         (result.accepted ? "accepted" : message + result.problem) + ")";
    // Deflate saves a factor of 1032 at most, a bitmap 8 values a byte.
    if (result.accepted && result.digest.items() > 1032 * 8 * size_of(folder))
        result.problem = "returns " + std::to_string(result.digest.items()) + " numbers";
    return result;
}

/// Twice where the first gives a result: memory that was never written differs.
Reading judged(const Format& format, const fs::path& path, const fs::path& folder) {
    Reading first = reading(format, path, folder, 0xa5);
    if (!first.accepted || !first.problem.empty()) return first;
    const Reading second = reading(format, path, folder, 0x5a);
    if (!second.accepted || second.digest.value() != first.digest.value())
        first.problem = "gives two results for one file: values that were not in it";
    return first;
}

void write_files(const Seed& seed, const fs::path& folder) {
    fs::remove_all(folder);
    fs::create_directories(folder);
    for (const auto& [name, file] : seed.files) std::ofstream(folder / name, std::ios::binary) << bytes_of(file);
}

/// What the sanitizers or the runtime said last.
std::string last_words(const fs::path& output) {
    std::ifstream file(output);
    std::string words, frames;
    for (std::string line; std::getline(file, line);) {
        for (const char* sign : {"runtime error", "SUMMARY", "terminate called", "what():"})
            if (line.find(sign) != std::string::npos) words = words.empty() ? line : words + " | " + line;
        if (line.find("tissuewarp::") != std::string::npos && frames.size() < 400) frames += " | " + line;
    }
    return words.substr(0, 800) + frames;
}

class Worker {
public:
    Worker(const Format& format, Shared& shared, const test::TemporaryFolder& folder)
        : format_(format), shared_(shared), folder_(folder.path()), output_(folder / "output.txt") {}

    [[noreturn]] void run(const std::function<CaseMaker(const std::vector<Seed>&)>& maker, std::uint64_t first,
                          std::uint64_t last) {
        const int output = ::open(output_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_APPEND, 0600);
        ::dup2(output, 1);
        ::dup2(output, 2);
        shared_.number = first;
        fs::create_directories(folder_ / "seeds");
        const CaseMaker files_of = maker(format_.seeds(folder_ / "seeds"));
        for (std::uint64_t number = first; number < last; ++number) {
            if (::ftruncate(output, 0) != 0) ::_exit(3);
            run_case(number, files_of(number));
        }
        ::_exit(0);
    }

private:
    const Format& format_;
    Shared& shared_;
    fs::path folder_, output_;

    void run_case(std::uint64_t number, const Seed& files) {
        const fs::path folder = folder_ / "case";
        shared_.number = number;
        write_files(files, folder);
        Random random(number);
        if (files.edited) format_.edit(folder / files.named, random);
        const std::int64_t start = now_ns();
        shared_.started_ns = start;
        Reading result = judged(format_, files.named.empty() ? folder : folder / files.named, folder);
        shared_.started_ns = 0;
        shared_.slowest = std::max(shared_.slowest.load(), 1e-9 * static_cast<double>(now_ns() - start));
        shared_.largest_peak = std::max(shared_.largest_peak.load(), peak_bytes());
        ++shared_.cases;
        if (result.accepted) ++shared_.accepted;
        if (files.must_be_read && !result.accepted) result.problem = "refuses what is right: " + result.message;
        if (result.problem.empty()) return;
        shared_.tell(result.problem);
        ::_exit(2);
    }
};

/// Ends the process when a case takes too long. Returns waitpid's status.
int wait_for(pid_t process, const Shared& shared, bool& hung) {
    int status = 0;
    while (::waitpid(process, &status, WNOHANG) == 0) {
        const std::int64_t started = shared.started_ns;
        if (started != 0 && 1e-9 * static_cast<double>(now_ns() - started) > most_seconds) {
            hung = true;
            ::kill(process, SIGKILL);
            ::waitpid(process, &status, 0);
            return status;
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return status;
}

std::string problem_of(int status, bool hung, const Shared& shared, const fs::path& output) {
    if (hung) return "takes more than ten seconds";
    if (WIFEXITED(status) && WEXITSTATUS(status) == 2) return shared.problem.data();
    if (WIFSIGNALED(status))
        return std::string("ends by signal ") + ::strsignal(WTERMSIG(status)) + ": " + last_words(output);
    return "exits with " + std::to_string(WEXITSTATUS(status)) + ": " + last_words(output);
}

}  // namespace

Tally supervised(const Format& format, const std::function<CaseMaker(const std::vector<Seed>&)>& maker,
                 std::uint64_t first, std::uint64_t last, const fs::path& failures) {
    void* memory = ::mmap(nullptr, sizeof(Shared), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (memory == MAP_FAILED) throw std::runtime_error("no shared memory");
    Shared& shared = *new (memory) Shared;
    const test::TemporaryFolder folder;
    const Clock::time_point start = Clock::now();
    Tally tally;
    while (first < last && tally.failures.size() < enough_failures) {
        shared.started_ns = 0;
        shared.problem.fill('\0');
        const pid_t process = ::fork();
        if (process < 0) throw std::runtime_error("no further process");
        if (process == 0) Worker(format, shared, folder).run(maker, first, last);
        bool hung = false;
        const int status = wait_for(process, shared, hung);
        if (WIFEXITED(status) && WEXITSTATUS(status) == 0) break;
        const std::uint64_t number = shared.number;
        tally.failures.push_back({number, problem_of(status, hung, shared, folder / "output.txt")});
        const fs::path kept = failures / (format.name + "-" + std::to_string(number));
        fs::create_directories(failures);
        fs::remove_all(kept);
        if (fs::exists(folder / "case")) fs::copy(folder / "case", kept);
        first = number + 1;
    }
    tally.cases = shared.cases;
    tally.accepted = shared.accepted;
    tally.seconds = std::chrono::duration<double>(Clock::now() - start).count();
    tally.slowest_seconds = shared.slowest;
    tally.largest_peak = shared.largest_peak;
    ::munmap(memory, sizeof(Shared));
    return tally;
}

}  // namespace tissuewarp::fuzz
