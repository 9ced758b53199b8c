#include "registration/field.hpp"
#include "registration/field/rasterisation.hpp"
#include "registration/matching/dense/image_engine.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/matching/points/template_images.hpp"
#include "registration/prepare.hpp"

#include <algorithm>
#include <optional>

namespace tissuewarp::registration::detail {

namespace {

/// 1 for the voxels of a grid whose centres lie in the mesh.
std::vector<std::uint8_t> voxels_in(const meshing::TetMesh& mesh, const imaging::Geometry& grid) {
    std::vector<std::uint8_t> inside(static_cast<std::size_t>(grid.voxel_count()));
    const Eigen::Matrix3Xd index = grid.point_to_index() * (mesh.nodes.colwise() - grid.origin);
    rasterise(index, mesh.tets, grid.size, [&](int, const Eigen::Vector4d&) {
        return [&](const TetRow& row) {
            const auto start = inside.begin() + grid.size[0] * (row.j + std::ptrdiff_t{grid.size[1]} * row.k);
            std::fill(start + row.first, start + row.last + 1, std::uint8_t{1});
        };
    });
    return inside;
}

class CpuImageEngine : public ImageEngine {
public:
    CpuImageEngine(const meshing::TetMesh& mesh, const ImageModel& image) : mesh_(mesh), image_(image) {}

    void begin_fixed(const imaging::Volume&) override {}

    void finish_fixed(const SeenImage& fixed) override {
        fixed_ = fixed;
        blocks_ = make_cpu_block_engine(image_.blocks.images(), *fixed_);
    }

    DenseForces forces(const State& state, std::size_t level) override {
        const TemplateImages& images = image_.blocks.images();
        const MatchingImage& moving = images.levels.at(level);
        const imaging::Volume field = displacement_near_mesh({mesh_, state.displacement, state.placement},
                                                             GridSamples::with_rim(moving.grid), descriptor_extent);
        const MatchingImage pulled_back =
            pulled_back_image(fixed_->image, fixed_->seen, moving.grid, images.region(moving.grid), field);
        return dense_forces(moving, pulled_back, voxels_in(mesh_, moving.grid));
    }

    BlockEngine& blocks() override { return *blocks_; }
    EchoEngine& echoes() override { return echoes_; }

private:
    const meshing::TetMesh& mesh_;
    const ImageModel& image_;
    std::optional<SeenImage> fixed_;
    std::unique_ptr<BlockEngine> blocks_;
    CpuEchoEngine echoes_;
};

}  // namespace

std::unique_ptr<ImageEngine> make_cpu_image_engine(const meshing::TetMesh& mesh, const ImageModel& image) {
    return std::make_unique<CpuImageEngine>(mesh, image);
}

}  // namespace tissuewarp::registration::detail
