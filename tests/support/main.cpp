// Every test program's main: GoogleMock on one thread of OpenBLAS, whose threads spin where other tests run beside it.
#include <dlfcn.h>
#include <gmock/gmock.h>

int main(int argc, char** argv) {
    if (const auto set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"))) set(1);
    ::testing::InitGoogleMock(&argc, argv);
    return RUN_ALL_TESTS();
}
