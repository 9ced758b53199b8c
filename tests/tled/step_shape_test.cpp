// Shapes of GPU steps: what is suggested for a device, and names.
#include "tled/engine.hpp"

#include <gtest/gtest.h>

namespace tissuewarp::tled {
namespace {

// Patches that are no multiple of the multiprocessors leave some of these idle.
TEST(SuggestedStepShape, SharesOutAmongTheMultiprocessorsOfTheDevice) {
    const auto patches = [](int elements, const GpuStepShape& shape) { return (elements - 1) / shape.patch_tets + 1; };
    for (const int multiprocessors : {20, 84, 132})
        for (const int elements : {82944, 384000, 998250, 3072000}) {
            const GpuStepShape shape = suggested_gpu_step_shape(elements, Element::T4, multiprocessors);
            const int left_over = patches(elements, shape) % multiprocessors;
            EXPECT_TRUE(left_over == 0 || left_over > 0.9 * multiprocessors)
                << elements << " on " << multiprocessors << ": " << patches(elements, shape);
            EXPECT_EQ(shape.at_once % multiprocessors, 0);
        }
    EXPECT_EQ(suggested_gpu_step_shape(82944), suggested_gpu_step_shape(82944, Element::T4, 132));
    EXPECT_EQ(suggested_gpu_step_shape(82944), (GpuStepShape{629, 2, 512, 132}));
}

// One that needs more than OpenGL grants is refused by every device.
TEST(SuggestedStepShape, FitsIntoAWorkgroup) {
    for (const int multiprocessors : {0, 4, 30, 132})
        for (const Element element : {Element::T4, Element::AveragedPressureT4})
            for (const int elements : {1, 750, 6000, 16464, 82944, 384000, 998250, 3072000, 10110954}) {
                const GpuStepShape shape = suggested_gpu_step_shape(elements, element, multiprocessors);
                EXPECT_LE(shape.workgroup, 1024);
                EXPECT_LE(shape.patch_tets, 4450);
                EXPECT_TRUE(shape.longest_fan >= 1 && shape.longest_fan <= 5);
            }
}

TEST(StepShapeNames, SayWhatBenchmarksTake) {
    EXPECT_EQ(name_of(GpuStepShape{}), "two passes");
    EXPECT_EQ(name_of(GpuStepShape{2910, 5, 640, 0}), "2910:5:640");
    EXPECT_EQ(name_of(GpuStepShape{2910, 5, 640, 132}), "2910:5:640:132");
}

}  // namespace
}  // namespace tissuewarp::tled
