#pragma once
/// What the header of a sweep says of its frames.

#include <Eigen/Geometry>

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

namespace tissuewarp::imaging::detail {

/// Transforms between named coordinate systems, as one frame has them.
class FrameTransforms {
public:
    /// False where another way between the two is there.
    [[nodiscard]] bool add(const std::string& from, const std::string& to, const Eigen::Affine3d& transform);
    /// The shortest way through them, forth or back; nothing where there is none.
    [[nodiscard]] std::optional<Eigen::Affine3d> between(const std::string& from, const std::string& to) const;
    /// The names of all systems.
    [[nodiscard]] std::set<std::string> systems() const;

private:
    std::map<std::string, std::map<std::string, Eigen::Affine3d>> ways_;
};

struct FrameFields {
    bool image_ok = true;
    FrameTransforms transforms;  ///< those that are OK
};

/// Of the frames that fields "Seq_Frame0012_ProbeToReferenceTransform" and the like name, by number. Throws IoError for
/// one that is not 16 numbers of an affine transform, for two that contradict each other, and of a frame beyond
/// `count`.
std::map<int, FrameFields> frame_fields(const std::filesystem::path& path,
                                        const std::map<std::string, std::string>& fields, int count);

/// Of 16 numbers, row by row; where the third column is zero, as of calibrations of a plane, it becomes the normal.
/// `what` names them in messages. Throws IoError where they are others, or no affine
/// transform that can be inverted.
Eigen::Affine3d affine_of(const std::filesystem::path& path, const std::string& what, const std::string& text);

/// "Probe" and "Reference" of "ProbeToReference"; nothing of what is no such name.
std::optional<std::pair<std::string, std::string>> systems_of(const std::string& name);

}  // namespace tissuewarp::imaging::detail
