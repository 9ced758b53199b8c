#include "apps/blas.hpp"

#include <dlfcn.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <vector>

namespace tissuewarp::apps {

namespace {

std::string answer_of(const char* question) {
    const auto ask = reinterpret_cast<char* (*)()>(dlsym(RTLD_DEFAULT, question));
    return ask ? ask() : "";
}

/// Of OpenBLAS' names the best for this processor's vector units; nullptr where they are no more than a Prescott's.
const char* known_core() {
#ifdef __x86_64__
    if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl"))
        return "SkylakeX";
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return "Haswell";
#endif
    return nullptr;
}

/// OpenBLAS makes a thread per processor while it is loaded, and where it may not it ends the process with words of its
/// own, before main. Under a limit so low that this may happen the program starts again with OpenBLAS held to one
/// thread, and main says what is missing (apps/threads.hpp). Runs before the libraries begin, so it may use
/// nothing of them but memory.
void start_again_if_blas_may_not_make_threads(int, char** argv, char** environment) {
    constexpr rlim_t enough = 1024;  // processes of this user, more than any machine's processors and its desktop
    static char one_thread[] = "OPENBLAS_NUM_THREADS=1";
    rlimit limit{};
    if (getrlimit(RLIMIT_NPROC, &limit) != 0 || limit.rlim_cur >= enough) return;
    std::vector<char*> variables{one_thread};
    for (char** variable = environment; *variable; ++variable) {
        if (std::strncmp(*variable, one_thread, sizeof one_thread - 2) == 0) return;  // the user's choice, or ours
        variables.push_back(*variable);
    }
    variables.push_back(nullptr);
    execve("/proc/self/exe", argv, variables.data());
}

[[gnu::section(".preinit_array"),
  gnu::used]] void (*const before_libraries)(int, char**, char**) = start_again_if_blas_may_not_make_threads;

}  // namespace

void start_again_if_blas_mistook_the_processor(char** argv) {
    constexpr const char* variable = "OPENBLAS_CORETYPE";
    if (std::getenv(variable) || answer_of("openblas_get_corename") != "Prescott") return;
    const char* core = known_core();
    if (!core || setenv(variable, core, 0) != 0) return;
    execv("/proc/self/exe", argv);
    unsetenv(variable);  // it could not be started: this one goes on
}

std::string blas_name() {
    const std::string config = answer_of("openblas_get_config");
    return config.empty() ? "not OpenBLAS" : config;
}

}  // namespace tissuewarp::apps
