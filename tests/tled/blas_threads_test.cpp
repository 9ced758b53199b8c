// Whose the threads of the BLAS are: the host's, unless it lets solves change them.
#include "tled/blas_threads.hpp"
#include "tests/tled/equilibrium_scenes.hpp"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <oneapi/tbb/global_control.h>

#include <atomic>
#include <filesystem>
#include <iterator>
#include <set>
#include <thread>

namespace tissuewarp::tled {
namespace {

class BlasThreads : public ::testing::Test {
protected:
    void SetUp() override {
        set = reinterpret_cast<void (*)(int)>(dlsym(RTLD_DEFAULT, "openblas_set_num_threads"));
        count = reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "openblas_get_num_threads"));
        if (!set || !count) GTEST_SKIP() << "the BLAS is not OpenBLAS";
        before = count();
        set(2);
        if (count() != 2) GTEST_SKIP() << "OpenBLAS has one thread alone here";
    }
    void TearDown() override {
        let_solves_take_one_blas_thread(false);
        if (set) set(before);
    }

    /// The numbers that another thread of the process sees while this one factorises and solves.
    std::set<int> seen_while_solving() const {
        const SeedCube cube(Element::T4, 8);
        std::atomic<bool> solving = true;
        std::set<int> seen;
        std::thread watcher([&] {
            while (solving) seen.insert(count());
        });
        for (int i = 0; i < 20; ++i) {
            const RestStiffness stiffness(cube.rest, cube.conditions);
            stiffness.factorise();
            static_cast<void>(stiffness.solve(cube.rest.position));
        }
        solving = false;
        watcher.join();
        return seen;
    }

    void (*set)(int) = nullptr;
    int (*count)() = nullptr;
    int before = 1;
};

TEST_F(BlasThreads, AreLeftAlone) {
    EXPECT_EQ(seen_while_solving(), (std::set<int>{2}));
}

TEST_F(BlasThreads, AreOneWhileSolvingWhereTheHostAllowsIt) {
    let_solves_take_one_blas_thread(true);
    EXPECT_TRUE(seen_while_solving().contains(1));
    EXPECT_EQ(count(), 2);
}

/// CHOLMOD has three threads of OpenMP made, which spin, whatever --threads says.
TEST_F(BlasThreads, NoneOfOpenMpAreMade) {
    const auto threads = [] {
        return std::distance(std::filesystem::directory_iterator("/proc/self/task"),
                             std::filesystem::directory_iterator());
    };
    const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
    const SeedCube cube(Element::T4, 12);
    const auto levels = reinterpret_cast<int (*)()>(dlsym(RTLD_DEFAULT, "omp_get_max_active_levels"));
    const int levels_before = levels ? levels() : 0;
    const RestStiffness stiffness(cube.rest, cube.conditions);
    const auto threads_before = threads();
    stiffness.factorise();
    static_cast<void>(stiffness.solve(cube.rest.position));
    EXPECT_EQ(threads(), threads_before);
    EXPECT_EQ(levels ? levels() : 0, levels_before) << "OpenMP is left as it was";
}

}  // namespace
}  // namespace tissuewarp::tled
