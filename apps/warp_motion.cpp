#include "apps/warp_motion.hpp"

#include "apps/file_kind.hpp"
#include "core/errors.hpp"
#include "meshing/point_location.hpp"
#include "registration/field/mesh_labels.hpp"
#include "registration/record.hpp"
#include "registration/resection/gap.hpp"
#include "simulation/series_frame.hpp"

#include <fmt/format.h>

namespace tissuewarp::apps {

std::optional<WarpMotion> read_motion(const WarpOptions& options, Observer& observer) {
    if (options.record.empty() && options.displacement.empty())
        throw InvalidInput("nothing to warp with; give --record record.h5 or --displacement FIELD");
    if (file_kind(options.displacement) == FileKind::Record) {
        simulation::SeriesFrame frame = simulation::read_frame(options.displacement, options.frame);
        observer.note(fmt::format("'{}': frame {}, at {:g} s", options.displacement.string(), frame.index, frame.time));
        return WarpMotion{{std::move(frame.mesh), std::move(frame.displacement)}, std::move(frame.gone), {}};
    }
    if (options.frame >= 0)
        throw InvalidInput(
            "--frame is of a scene; give --displacement displacement.h5 as tissuewarp simulate wrote it");
    if (options.record.empty()) return std::nullopt;
    registration::Record record = registration::read_record(options.record);
    return WarpMotion{std::move(record.deformation), {}, std::move(record.resected)};
}

void take_out(imaging::Volume& image, const WarpMotion& motion, double outside, const std::filesystem::path& path) {
    const auto shown = [&](const meshing::TetMesh& mesh) {
        return registration::labels_of_mesh(mesh, image.geometry).voxels.reshape(1, 1) > 0;
    };
    if (motion.gone.tet_count() > 0) {
        const cv::Mat flat = image.voxels.reshape(image.channels(), 1);
        cv::Mat(flat).setTo(cv::Scalar::all(outside), shown(motion.gone));
    }
    if (cv::countNonZero(shown(motion.deformation.mesh)) == 0)
        throw InvalidInput(
            fmt::format("'{}' shows nothing of the tissue that moved; give an image of the frame that it was meshed in",
                        path.string()));
}

std::vector<bool> points_gone(const Eigen::Matrix3Xd& points, const WarpMotion& motion) {
    if (!motion.resected.empty()) return registration::points_gone(motion.deformation, motion.resected, points);
    std::vector<bool> gone(static_cast<std::size_t>(points.cols()), false);
    if (motion.gone.tet_count() == 0) return gone;
    const meshing::PointLocator taken(motion.gone), left(motion.deformation.mesh);
    for (Eigen::Index p = 0; p < points.cols(); ++p)
        gone[static_cast<std::size_t>(p)] = taken.find(points.col(p)) && !left.find(points.col(p));
    return gone;
}

}  // namespace tissuewarp::apps
