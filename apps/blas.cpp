#include "apps/blas.hpp"

#include <dlfcn.h>
#include <unistd.h>

#include <cstdlib>

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
