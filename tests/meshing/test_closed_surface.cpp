#include "core/errors.hpp"
#include "meshing/closed_surface.hpp"
#include "meshing/primitives.hpp"

#include <gmock/gmock.h>

namespace tissuewarp::meshing {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

SurfaceMesh box() {
    return boundary_surface(box_mesh({2, 3, 4}, {2, 2, 2})).surface;
}

std::string refusal(const SurfaceMesh& surface) {
    try {
        (void)closed_surface(surface);
    } catch (const InvalidInput& problem) {
        return problem.what();
    }
    return {};
}

TEST(ClosedSurface, MergesTheCornersOfAnStlFile) {
    const SurfaceMesh whole = box();
    SurfaceMesh soup;
    soup.nodes.resize(3, 3 * whole.triangles.cols());
    soup.triangles.resize(3, whole.triangles.cols());
    for (int corner = 0; corner < soup.nodes.cols(); ++corner) {
        soup.nodes.col(corner) = whole.nodes.col(whole.triangles(corner % 3, corner / 3));
        soup.triangles(corner % 3, corner / 3) = corner;
    }
    const ClosedSurface closed = closed_surface(soup);
    EXPECT_EQ(closed.mesh.node_count(), whole.node_count());
    EXPECT_NEAR(closed.volume_mm3, 24, 1e-12);
    EXPECT_THAT(closed.notes, IsEmpty());
}

TEST(ClosedSurface, CountsOpenEdges) {
    SurfaceMesh open = box();
    open.triangles.conservativeResize(3, open.triangles.cols() - 1);
    EXPECT_THAT(refusal(open), HasSubstr("3 open edges"));
    open.triangles.resize(3, 0);
    EXPECT_THAT(refusal(open), HasSubstr("no triangles"));
}

TEST(ClosedSurface, TurnsWhatFacesInwardAndSaysWhereTrianglesDisagree) {
    SurfaceMesh surface = box();
    surface.triangles.row(0).swap(surface.triangles.row(1));
    const ClosedSurface turned = closed_surface(surface);
    EXPECT_NEAR(turned.volume_mm3, 24, 1e-12);
    EXPECT_THAT(turned.notes.at(0), HasSubstr("turned"));
    std::swap(surface.triangles(0, 0), surface.triangles(1, 0));
    const ClosedSurface mixed = closed_surface(surface);
    EXPECT_EQ(mixed.volume_mm3, 0);
    EXPECT_THAT(mixed.notes.at(0), HasSubstr("3 edges"));
}

}  // namespace
}  // namespace tissuewarp::meshing
