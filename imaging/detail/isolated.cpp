#include "imaging/detail/isolated.hpp"

#include <fcntl.h>
#include <malloc.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>

namespace tissuewarp::imaging::detail {

namespace {

/// Zeroed memory that a copy of this process shares with it.
class SharedBytes {
public:
    explicit SharedBytes(std::size_t count)
        : count_(count), bytes_(::mmap(nullptr, count, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0)) {}
    ~SharedBytes() {
        if (valid()) ::munmap(bytes_, count_);
    }
    SharedBytes(const SharedBytes&) = delete;
    SharedBytes& operator=(const SharedBytes&) = delete;

    [[nodiscard]] bool valid() const { return bytes_ != MAP_FAILED; }
    [[nodiscard]] char* data() const { return static_cast<char*>(bytes_); }

private:
    std::size_t count_;
    void* bytes_;
};

/// In the copy: silent, without a core file, and not for ever.
[[noreturn]] void decode_and_exit(const std::function<bool(char*)>& decode, char* bytes, unsigned seconds,
                                  int pattern) {
    for (const int sign : {SIGABRT, SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGTERM, SIGHUP, SIGINT, SIGALRM})
        std::signal(sign, SIG_DFL);
    const rlimit none{0, 0};
    ::setrlimit(RLIMIT_CORE, &none);
    if (const int nowhere = ::open("/dev/null", O_WRONLY); nowhere >= 0) ::dup2(nowhere, STDERR_FILENO);
    ::alarm(seconds);
    ::mallopt(M_PERTURB, pattern);
    bool done = false;
    try {
        done = decode(bytes);
    } catch (...) {  // as any other failure
    }
    ::_exit(done ? 0 : 1);
}

bool ended_well(pid_t process) {
    int status = 0;
    while (process > 0 && ::waitpid(process, &status, 0) < 0)
        if (errno != EINTR) return false;
    return process > 0 && WIFEXITED(status) && WEXITSTATUS(status) == 0;
}

}  // namespace

bool decode_isolated(const std::function<bool(char* bytes)>& decode, char* target, std::size_t count) {
    constexpr std::size_t bytes_per_second = 1 << 20;  // slower than any decoder
    const auto seconds = static_cast<unsigned>(5 + count / bytes_per_second);
    const SharedBytes one(count), two(count);
    if (count == 0 || !one.valid() || !two.valid()) return false;
    std::memset(two.data(), 0xff, count);
    pid_t processes[2] = {};
    for (int copy = 0; copy < 2; ++copy) {
        processes[copy] = ::fork();
        if (processes[copy] == 0)
            decode_and_exit(decode, (copy == 0 ? one : two).data(), seconds, copy == 0 ? 0x5a : 0xa5);
    }
    const bool first = ended_well(processes[0]), second = ended_well(processes[1]);
    if (!first || !second || std::memcmp(one.data(), two.data(), count) != 0) return false;
    std::memcpy(target, one.data(), count);
    return true;
}

}  // namespace tissuewarp::imaging::detail
