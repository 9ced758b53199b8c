#include "apps/registration_checks.hpp"

#include "core/errors.hpp"
#include "imaging/dicom_origin.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace tissuewarp::apps {

void require_data(IntraoperativeOptions& o) {
    if (o.fixed_labels.empty() && o.fixed_surface.empty() && o.point_pairs.fixed.empty() && o.curves.fixed.empty())
        o.match_image = true;
    if (o.match_image && o.fixed.empty())
        throw InvalidInput(
            "nothing to register to; give --fixed, --fixed-labels, --fixed-surface, --fixed-points or "
            "--fixed-curves, or several (docs/which-data.md)");
}

void refuse_without_labels(const PreoperativeOptions& o, const char* option) {
    if (!o.moving_labels.empty() || !o.moving_surface.empty() || !o.moving_mesh.empty()) return;
    throw InvalidInput(std::string(option) +
                       " speaks of labels, and there are none of the moving image; give --moving-labels");
}

void require_organ(const PreoperativeOptions& o) {
    if (!o.moving_mesh.empty()) {
        if (o.edge_length > 0 || !o.label_edge_length.empty())
            throw InvalidInput("--moving-mesh is taken as it is; leave out --edge-length and --label-edge-length");
        if (!o.rigid_neighbours.empty())
            throw InvalidInput("--rigid-neighbour is not meshed, and --moving-mesh is; give --moving-labels instead");
        if (!o.resected.empty())
            throw InvalidInput("--resected is not meshed, and --moving-mesh is; give --moving-labels instead");
    }
    if (o.moving.empty() && o.moving_labels.empty() && o.moving_surface.empty() && o.moving_mesh.empty())
        throw InvalidInput(
            "nothing says where the organ is; give --moving-labels, --moving-surface, --moving-mesh or --moving "
            "(docs/which-data.md)");
    if (!o.anchors.empty()) refuse_without_labels(o, "--anchor");
    if (!o.rigid_neighbours.empty()) refuse_without_labels(o, "--rigid-neighbour");
    if (!o.resected.empty()) refuse_without_labels(o, "--resected");
    if (!o.sliding.empty()) refuse_without_labels(o, "--sliding");
}

void require_where_to_find_resection(const RegisterOptions& o) {
    if (!o.find_resected) return;
    if (!o.match_image && o.fixed_labels.empty())
        throw InvalidInput(
            "--resected auto looks for what is gone in an image or labels; give --match-image or --fixed-labels, or "
            "name "
            "labels");
    if (!o.moving_mesh.empty())
        throw InvalidInput("--resected auto meshes the organ anew, and --moving-mesh is; give --moving-labels instead");
}

void require_pairs(const RegisterOptions& o) {
    if (o.moving_contrasts.size() != o.fixed_contrasts.size())
        throw InvalidInput(fmt::format(
            "--moving is given {} times and --fixed {}; contrasts are matched pair by pair: give both as often",
            1 + o.moving_contrasts.size(), 1 + o.fixed_contrasts.size()));
    require_contrasts_matched(o);
}

void require_contrasts_matched(const RegisterOptions& o) {
    if (!o.fixed_contrasts.empty() && !o.match_image)
        throw InvalidInput("further contrasts are there to be matched, and images are not; add --match-image");
}

void require_what_is_written(const RegisterOptions& o) {
    const auto names = [&](const char* word) {
        return std::find(o.write.begin(), o.write.end(), word) != o.write.end();
    };
    if (names("dicom") && !imaging::is_dicom(o.fixed))
        throw InvalidInput(
            "--write dicom writes objects that belong to the study of the fixed series; give --fixed as DICOM");
    if (names("markups") && !o.landmarks.given() && o.points.empty())
        throw InvalidInput(
            "--write markups writes points that are carried along, and there are none; give "
            "--landmarks or --points");
}

}  // namespace tissuewarp::apps
