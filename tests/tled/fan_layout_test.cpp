/// The patches and fans of the CPU engine, against the rest state that they are cut from.
#include "tled/cpu/fan_layout.hpp"

#include "core/errors.hpp"
#include "tests/tled/engine_scene.hpp"

#include <gmock/gmock.h>

#include <numeric>
#include <set>

namespace tissuewarp::tled::detail {
namespace {

using namespace scene;

class FanLayouts : public ::testing::TestWithParam<Element> {
protected:
    Model model = cube(5, GetParam(), Laws::Mixed);
    RestState rest = rest_state(model);
    FanLayout layout = fan_layout(rest, 100);

    [[nodiscard]] int mesh_node(const FanPatch& patch, std::size_t local) const {
        return layout.mesh_node[layout.nodes.node[patch.first_node + local]];
    }
};

INSTANTIATE_TEST_SUITE_P(All, FanLayouts, ::testing::Values(Element::T4, Element::AveragedPressureT4),
                         [](const auto& each) { return std::string(name_of(each.param)); });

TEST_P(FanLayouts, HasEveryElementInOneSlotOfItsMaterial) {
    std::vector<int> found;
    for (const BatchBlock& block : layout.batches.blocks)
        for (std::size_t slot = block.begin * batch_width; slot < block.end * batch_width; ++slot) {
            const int e = layout.batches.element[slot];
            if (e < 0) continue;
            found.push_back(e);
            EXPECT_EQ(layout.batches.slot[static_cast<std::size_t>(e)], slot);
            EXPECT_EQ(material_of_elements(rest)[static_cast<std::size_t>(e)], block.material);
        }
    std::sort(found.begin(), found.end());
    std::vector<int> all(static_cast<std::size_t>(rest.element_count()));
    std::iota(all.begin(), all.end(), 0);
    EXPECT_EQ(found, all);
    EXPECT_GT(layout.patches.size(), 2U) << "the test cuts nothing";
}

// A failure looks like: forces of the right size on the wrong corners.
TEST_P(FanLayouts, NodesOfFansAreThoseOfTheirElementsInTheStatedOrder) {
    std::size_t longest = 0;
    for (const FanPatch& patch : layout.patches)
        for (std::size_t g = patch.first_group; g < patch.end_group; ++g) {
            const FanGroup& group = layout.groups[g];
            longest = std::max(longest, static_cast<std::size_t>(group.length));
            const auto node = [&](std::size_t place, std::size_t lane) {
                const std::size_t at = patch.first_fan_node + group.first_place + place * batch_width + lane;
                return mesh_node(patch, layout.nodes.fan_node[at]);
            };
            for (std::size_t k = 0; k < static_cast<std::size_t>(group.length); ++k)
                for (std::size_t lane = 0; lane < batch_width; ++lane) {
                    const int e = layout.batches.element[(group.first_batch + k) * batch_width + lane];
                    if (e < 0) continue;
                    const auto& corner = layout.corner[static_cast<std::size_t>(e)];
                    const std::array<int, 4> of_fan{node(0, lane), node(1, lane), node(2 + k, lane), node(3 + k, lane)};
                    for (std::size_t c = 0; c < 4; ++c) EXPECT_EQ(of_fan[c], rest.nodes(corner[c], e));
                }
        }
    EXPECT_GT(longest, 1U) << "the test has no fans";
}

TEST_P(FanLayouts, ListsEveryPlaceOfAnElementUnderItsNodeOnce) {
    for (const FanPatch& patch : layout.patches) {
        std::set<std::size_t> listed;
        for (std::size_t i = 0; i < patch.node_count; ++i)
            for (std::size_t k = layout.nodes.place_begin[patch.first_node + i];
                 k < layout.nodes.place_begin[patch.first_node + i + 1]; ++k) {
                const std::size_t place = layout.nodes.scalar_place[k];
                EXPECT_EQ(layout.nodes.fan_node[patch.first_fan_node + place], i);
                EXPECT_TRUE(listed.insert(place).second);
            }
        std::size_t expected = 0;
        for (std::size_t g = patch.first_group; g < patch.end_group; ++g)
            for (std::size_t lane = 0; lane < batch_width; ++lane)
                if (layout.batches.element[layout.groups[g].first_batch * batch_width + lane] >= 0)
                    expected += static_cast<std::size_t>(layout.groups[g].length) + 3;
        EXPECT_EQ(listed.size(), expected);
    }
}

// A failure looks like: a node that moves while another thread still reads where it was.
TEST_P(FanLayouts, OwnNodesAreOfOnePatch) {
    std::vector<int> users(static_cast<std::size_t>(rest.node_count));
    for (const FanPatch& patch : layout.patches)
        for (std::size_t i = 0; i < patch.node_count; ++i) ++users[static_cast<std::size_t>(mesh_node(patch, i))];
    std::size_t own = 0;
    for (const FanPatch& patch : layout.patches) {
        EXPECT_EQ(patch.first_own, patch.own_count > 0 ? own : 0);
        for (std::size_t i = 0; i < patch.node_count; ++i) {
            EXPECT_EQ(users[static_cast<std::size_t>(mesh_node(patch, i))] == 1, i < patch.own_count);
            if (i < patch.own_count) {
                EXPECT_EQ(layout.nodes.node[patch.first_node + i], patch.first_own + i);
            }
        }
        own += patch.own_count;
    }
    EXPECT_EQ(layout.own_nodes, own);
    EXPECT_GT(own, 0U);
}

TEST_P(FanLayouts, PadsNoMoreThanOneGroupOfAPatch) {
    for (const FanPatch& patch : layout.patches)
        for (std::size_t g = patch.first_group; g + 1 < patch.end_group; ++g) {
            const FanGroup& group = layout.groups[g];
            for (std::size_t i = 0; i < static_cast<std::size_t>(group.length) * batch_width; ++i)
                EXPECT_GE(layout.batches.element[group.first_batch * batch_width + i], 0);
        }
}

TEST(FanLayout, RefusesPatchesWhosePlacesDoNotFit) {
    const RestState rest = rest_state(cube(24, Element::T4, Laws::LnJ));
    EXPECT_THROW(fan_layout(rest, 1000000), InvalidInput);
}

}  // namespace
}  // namespace tissuewarp::tled::detail
