#include "server/computation.hpp"

#include "meshing/tet_mesh.hpp"
#include "registration/field.hpp"
#include "registration/resection/gap.hpp"
#include "registration/surroundings/rigid_surroundings.hpp"
#include "registration/warp.hpp"
#include "server/crc64.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace tissuewarp::server {

namespace {

using namespace registration;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
    return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Adds its own lifetime to the stages of an update.
class Stage {
public:
    Stage(const char* name, Products& products) : name_(name), products_(products) {}
    ~Stage() { add_time(products_.result.times, name_, seconds_since(start_)); }
    Stage(const Stage&) = delete;
    Stage& operator=(const Stage&) = delete;

private:
    const char* name_;
    Products& products_;
    Clock::time_point start_ = Clock::now();
};

std::string sureness(const Products& products, const std::optional<ErrorEstimate>& estimate) {
    if (products.doubted()) return "doubted";
    if (!products.uncertainty) return "error not estimated";
    if (!estimate) return "outside the tissue";
    return fmt::format("95 % within {:.1f} mm", estimate->interval_mm);
}

/// Where no image of the operation gives a grid: the moving one, carried along by the rigid placement.
imaging::Geometry output_grid(const Job& job, const imaging::Geometry& moving, const Eigen::Isometry3d& placement) {
    if (job.grid) return *job.grid;
    imaging::Geometry grid = moving;
    grid.origin = placement * grid.origin;
    grid.direction = placement.linear() * grid.direction;
    return grid;
}

std::string digest_of(const Deformation& deformation) {
    const auto bytes = [](const double* numbers, Eigen::Index count) {
        return ByteView(reinterpret_cast<const unsigned char*>(numbers),
                        sizeof(double) * static_cast<std::size_t>(count));
    };
    const std::uint64_t moved = crc64(bytes(deformation.displacement.data(), deformation.displacement.size()));
    return fmt::format("{:016x}", crc64(bytes(deformation.placement.matrix().data(), 16), moved));
}

bool same_updater(const Request& a, const Request& b) {
    return a.rounds == b.rounds && a.tolerance_mm == b.tolerance_mm && a.align == b.align;
}

}  // namespace

PolyData organ_of(const Products& products) {
    const Deformation& deformation = products.result.deformation;
    const meshing::BoundarySurface boundary = meshing::boundary_surface(deformation.deformed_mesh());
    PolyData organ{boundary.surface.nodes, {}, {}, boundary.surface.triangles, {}};
    organ.normals.resize(3, 0);
    const auto array = [&](const char* name, const auto& value_at) {
        Eigen::RowVectorXd values(organ.points.cols());
        for (Eigen::Index n = 0; n < values.size(); ++n)
            values[n] = value_at(boundary.node_of[static_cast<std::size_t>(n)]);
        organ.point_arrays.push_back({name, values});
    };
    if (products.uncertainty) {
        const std::vector<ErrorEstimate> errors = products.uncertainty->at_nodes();
        const auto error = [&](int node) -> const ErrorEstimate& { return errors[static_cast<std::size_t>(node)]; };
        const bool doubted = products.doubted();
        array("interval_95_mm", [&](int node) { return error(node).interval_mm; });
        array("deviation_mm", [&](int node) { return error(node).deviation_mm; });
        // Of a doubted result nothing is to be trusted, whatever the estimate says of its places.
        array("trust", [&](int node) { return doubted ? double(Trust::Unknown) : double(error(node).trust); });
    }
    const Eigen::RowVectorXd moved = (deformation.deformed_nodes() - deformation.mesh.nodes).colwise().norm();
    array("displacement_mm", [&](int node) { return moved[node]; });
    array("doubted", [&](int) { return products.doubted() ? 1.0 : 0.0; });
    return organ;
}

NamedPoints targets_of(const Products& products, const NamedPoints& targets, double fade_mm) {
    if (targets.empty()) return {};
    Eigen::Matrix3Xd places(3, static_cast<Eigen::Index>(targets.size()));
    for (std::size_t n = 0; n < targets.size(); ++n) places.col(static_cast<Eigen::Index>(n)) = targets[n].position;
    const Eigen::Matrix3Xd now = PointTransform(products.result.deformation, {fade_mm})(places);
    std::vector<std::optional<ErrorEstimate>> estimates(targets.size());
    if (products.uncertainty) estimates = products.uncertainty->at(places);
    NamedPoints carried = targets;
    for (std::size_t n = 0; n < targets.size(); ++n) {
        carried[n].position = now.col(static_cast<Eigen::Index>(n));
        carried[n].group = sureness(products, estimates[n]);
    }
    return carried;
}

void Computer::use_options(const Request& request, Observer& observer) {
    if (updater_ && same_updater(*made_for_, request)) return;
    UpdateOptions options = patient_.update;
    options.align = request.align;
    options.rematches = request.rounds;
    options.equilibrium.tolerance_mm = request.tolerance_mm;
    updater_.emplace(patient_.model, options, observer);
    made_for_ = request;
}

void Computer::estimate_errors(Products& products, Observer& observer) const {
    if (!products.request.error_estimate) return;
    const Stage stage("error estimate", products);
    products.uncertainty = uncertainty(*patient_.model, products.result, {}, observer);
    for (Doubt& doubt : doubts_of(*products.uncertainty, products.request.tolerance_mm))
        products.result.doubts.push_back(std::move(doubt));
}

Products Computer::compute(const Job& job, const Products* last, Observer& observer) {
    const auto start = Clock::now();
    use_options(job.request, observer);
    Products products;
    products.request = job.request;
    const bool goes_on = last && !job.request.begin_anew && same_updater(last->request, job.request);
    products.result =
        goes_on ? updater_->go_on(last->result, job.seen, observer) : updater_->update(job.seen, observer);
    estimate_errors(products, observer);
    if (products.result.beginning.at_last && products.doubted() && !last->doubted()) {
        const double in_vain = seconds_since(start);
        products.result = updater_->update(job.seen, observer);
        products.result.beginning.why = "its errors were doubted";
        add_time(products.result.times, stages::in_vain, in_vain);
        estimate_errors(products, observer);
    }
    if (job.seen.image && !patient_.image.empty()) {
        const Stage stage("surroundings", products);
        Deformation& deformation = products.result.deformation;
        deformation.surroundings =
            rigid_surroundings(deformation, patient_.image, *job.seen.image, {job.request.fade_mm}, observer);
    }
    {
        const Stage stage("organ and targets", products);
        products.organ = organ_of(products);
        products.targets = targets_of(products, job.targets, job.request.fade_mm);
    }
    if (!job.request.send.empty()) make_images(products, job, observer);
    products.digest = digest_of(products.result.deformation);
    products.seconds = seconds_since(start);
    products.time_s = now_s();
    return products;
}

void Computer::make_images(Products& products, const Job& job, Observer& observer) const {
    const Stage stage("images", products);
    const auto wanted = [&](const char* name) {
        return std::find(job.request.send.begin(), job.request.send.end(), name) != job.request.send.end();
    };
    const imaging::Geometry& moving = patient_.image.empty() ? patient_.labels.geometry : patient_.image.geometry;
    const Deformation& deformation = products.result.deformation;
    const imaging::Geometry grid = output_grid(job, moving, deformation.placement);
    products.field = displacement_fixed_to_moving(deformation, grid, {job.request.fade_mm}, observer);
    unfold_fixed_to_moving(products.field, deformation);
    if (wanted("warped")) {
        if (patient_.image.empty()) throw InvalidInput("the patient was prepared without an image to warp");
        products.warped = warp_image(patient_.image, products.field);
        if (const imaging::Volume& resected = patient_.model->resected; !resected.empty())
            leave_gap(products.warped, gap_after(deformation, resected, products.field));
    }
    if (!wanted("field")) products.field = {};
}

}  // namespace tissuewarp::server
