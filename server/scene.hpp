#pragma once
/// What clients have said of the operation so far.

#include "registration/intraoperative.hpp"
#include "server/messages.hpp"
#include "server/touched_patch.hpp"

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::server {

/// How far the data of each kind may be trusted, mm: standard deviations of one point.
struct Deviations {
    double surface_mm = 1, points_mm = 1, curves_mm = 1;
};

/// What is known now. A device's name says what its message is (docs/manual/serve.md); its next one takes the place of
/// the last, but for touches, which are gathered. Copies share voxels.
class Scene {
public:
    /// Takes in what a device sent, and when by its clock (s; 0: not known); an empty mesh or list withdraws it. Throws
    /// InvalidInput for a name that stands for nothing, or for something else.
    void take(const std::string& device, const Message& message, double seconds = 0);
    /// Withdraws what has this name. Throws InvalidInput where nothing may have it.
    void forget(const std::string& name);
    /// Withdraws what was touched under these ids. Throws InvalidInput where nothing was; then all of it stays.
    void forget_touched(const std::vector<std::string>& ids);
    /// From now on transforms of this device are touches of the organ's surface; without a device none are. Throws
    /// InvalidInput for a device that has another meaning.
    void gather(const Gathering& gathering);

    /// How many messages changed it: greater is newer.
    [[nodiscard]] long long state() const { return state_; }
    /// Names of what is there, of data to register to.
    [[nodiscard]] std::vector<std::string> data() const;
    /// Of the names in `use`, or everything where it is empty. Throws InvalidInput where one of them is not there, and
    /// where pairs of points share no name.
    [[nodiscard]] registration::Intraoperative seen(const std::vector<std::string>& use,
                                                    const Deviations& deviations) const;
    [[nodiscard]] const TouchedPatch& touched() const { return touched_; }
    [[nodiscard]] const NamedPoints& targets() const { return targets_; }
    void set_targets(NamedPoints targets) { targets_ = std::move(targets); }
    /// Where a warped image is wanted: that of the image or of the labels; or nothing.
    [[nodiscard]] const imaging::Geometry* grid() const;

private:
    void take_points(const std::string& name, const NamedPoints& points, double seconds);
    void take_mesh(const std::string& name, const PolyData& mesh);
    void take_image(const std::string& name, const imaging::Volume& image);
    /// Whether it changed anything.
    bool take_transform(const std::string& name, const Eigen::Isometry3d& transform, double seconds);
    [[nodiscard]] registration::SurfacePoints surface(bool patch, bool touched) const;
    [[nodiscard]] registration::PointPairs pairs() const;

    long long state_ = 0;
    NamedPoints moving_points_, fixed_points_, targets_;
    std::optional<PolyData> surface_, moving_curves_, fixed_curves_;
    std::map<std::string, imaging::Volume> images_;  // "fixed", "fixed_2", …, "fixed_labels"
    TouchedPatch touched_;
    Gathering gathering_;
    std::optional<Eigen::Isometry3d> start_;
};

/// "Fixed Surface" and "fixed-surface" are "fixed_surface".
std::string plain_name(const std::string& device);

}  // namespace tissuewarp::server
