#pragma once
/// Bricks of voxels, and Gaussian windows over bricks that hold something.

#include "registration/matching/ultrasound/echo_images.hpp"

#include <Eigen/Core>

#include <array>
#include <cstddef>
#include <utility>
#include <vector>

namespace tissuewarp::registration::detail {

/// Windows about bricks, smoothed axis by axis, k first, over those bricks alone that can tell something.
class BrickWindows {
public:
    /// Bricks of `side`³ voxels; a window is looked at when the ultrasound shows at least so much of it.
    BrickWindows(const EchoImages& images, int side, double deviation_mm, double least_share);

    /// Of the bricks' middles.
    [[nodiscard]] const imaging::Geometry& grid() const { return grid_; }
    /// Bricks whose windows are looked at, and how much of each is seen.
    [[nodiscard]] const std::vector<std::size_t>& places() const { return places_; }
    [[nodiscard]] const std::vector<float>& shares() const { return shares_; }

    /// Bricks with voxels that are seen; those whose windows along k are needed; those along k and j.
    [[nodiscard]] const std::vector<std::size_t>& filled() const { return filled_; }
    [[nodiscard]] const std::vector<std::size_t>& along_k() const { return along_k_; }
    [[nodiscard]] const std::vector<std::size_t>& along_kj() const { return along_kj_; }

    /// From one brick to the next.
    [[nodiscard]] std::ptrdiff_t step(int axis) const { return steps_[static_cast<std::size_t>(axis)]; }
    /// The first and the last brick of a window, from its middle.
    [[nodiscard]] std::pair<int, int> window(int axis, std::size_t brick) const;
    /// Bricks from the middle of a window to its end.
    [[nodiscard]] int radius() const { return radius_; }
    /// Of the brick `d` from the middle.
    [[nodiscard]] float weight(int d) const { return weights_[static_cast<std::size_t>(d + radius_)]; }

    /// `visit(n, from, brick)` for each voxel n that is seen, where the image shifted by so many voxels has its voxel
    /// `from` there.
    template <class Visit>
    void each_voxel(const Eigen::Vector3i& shift, const Visit& visit) const {
        const std::array<int, 3>& size = voxels_;
        const std::ptrdiff_t away = shift[0] + size[0] * (shift[1] + std::ptrdiff_t{size[1]} * shift[2]);
        const auto inside = [&](const Eigen::Vector3i& at) {
            return (at.array() >= 0).all() && at[0] < size[0] && at[1] < size[1] && at[2] < size[2];
        };
        for (const SeenVoxel& voxel : seen_)
            if (inside(voxel.at - shift))
                visit(voxel.n, static_cast<std::size_t>(static_cast<std::ptrdiff_t>(voxel.n) - away), voxel.brick);
    }

private:
    struct SeenVoxel {
        std::size_t n, brick;
        Eigen::Vector3i at;
    };

    imaging::Geometry grid_;
    std::array<int, 3> voxels_{};
    std::array<std::ptrdiff_t, 3> steps_{};
    int radius_ = 1;
    std::vector<float> weights_;  // 1 / side in all, so that a window over what is seen everywhere holds 1
    std::vector<SeenVoxel> seen_;
    std::vector<std::size_t> filled_, along_k_, along_kj_, places_;
    std::vector<float> shares_;

    void find_seen(const EchoImages& images, int side);
    void find_places(double least_share);
    /// Bricks with one of these in their window along an axis.
    [[nodiscard]] std::vector<bool> spread(const std::vector<bool>& bricks, int axis) const;
};

}  // namespace tissuewarp::registration::detail
