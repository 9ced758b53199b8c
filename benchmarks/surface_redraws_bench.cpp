// Registration from random parts of a surface: distribution of errors, and what the program says of its failures.
//     surface_redraws_bench DATA [--count N] [--first SEED] [--folder NAME] [--deviation MM] [--mesh-edge MM]
//                           [--surface-patch MM] [--load-shapes N]
// DATA/NAME (phantom-liver by default) holds preop_labels, intraop_labels and landmarks. A draw takes 10 to 60 % of the
// true intraoperative boundary that faces a random direction, 3000 points with noise, 0 to 30 % of them 5 to 25 mm off
// in random directions, normals in every second draw, and turns and shifts all by up to 30° and 40 mm.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "meshing/mesher.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "tled/blas_threads.hpp"

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <numeric>
#include <random>
#include <string>

using namespace tissuewarp;
using namespace tissuewarp::registration;
namespace fs = std::filesystem;

namespace {

struct Arguments {
    fs::path data;
    std::string folder = "phantom-liver";
    int count = 50, first = 1, load_shapes = TissuePrior{}.load_shapes;
    double deviation_mm = 0.7, edge_length = 0, patch = SurfaceOptions{}.patch_mm;
};

Arguments parse(int argc, char** argv) {
    if (argc < 2 || argc % 2 == 1) throw InvalidInput("see the head of surface_redraws_bench.cpp for the arguments");
    Arguments result{argv[1]};
    for (int n = 2; n < argc; n += 2) {
        const std::string key = argv[n], value = argv[n + 1];
        if (key == "--count")
            result.count = std::stoi(value);
        else if (key == "--first")
            result.first = std::stoi(value);
        else if (key == "--folder")
            result.folder = value;
        else if (key == "--deviation")
            result.deviation_mm = std::stod(value);
        else if (key == "--mesh-edge")
            result.edge_length = std::stod(value);
        else if (key == "--surface-patch")
            result.patch = std::stod(value);
        else if (key == "--load-shapes")
            result.load_shapes = std::stoi(value);
        else
            throw InvalidInput("unknown argument " + key + "; see the head of surface_redraws_bench.cpp");
    }
    return result;
}

struct Draw {
    double coverage = 0, outliers = 0, angle_deg = 0, shift_mm = 0;
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    SurfacePoints seen;
};

class Drawing {
public:
    Drawing(const meshing::SurfaceMesh& surface, unsigned seed) : surface_(surface), random_(seed) {}

    Draw draw(double deviation_mm, bool with_normals) {
        constexpr Eigen::Index count = 3000;
        Draw draw;
        draw.coverage = between(0.1, 0.6);
        draw.outliers = between(0.0, 0.3);
        draw.angle_deg = between(0, 30);
        draw.shift_mm = between(0, 40);
        const Eigen::Vector3d centre = surface_.nodes.rowwise().mean();
        draw.pose = Eigen::Translation3d(centre + draw.shift_mm * direction()) *
                    Eigen::AngleAxisd(draw.angle_deg * EIGEN_PI / 180, direction()) * Eigen::Translation3d(-centre);
        const auto [triangles, areas] = patch(draw.coverage);
        std::discrete_distribution<std::size_t> triangle(areas.begin(), areas.end());
        draw.seen.deviation_mm = deviation_mm;
        draw.seen.points.resize(3, count);
        Eigen::Matrix3Xd normals(3, count);
        for (Eigen::Index n = 0; n < count; ++n) {
            const auto [point, normal] = point_on(triangles[triangle(random_)]);
            Eigen::Vector3d seen = point + deviation_mm * gaussian();
            if (between(0, 1) < draw.outliers) seen += between(5, 25) * direction();
            draw.seen.points.col(n) = draw.pose * seen;
            normals.col(n) = draw.pose.linear() * (normal + 0.1 * gaussian()).normalized();
        }
        if (with_normals) draw.seen.normals = normals;
        return draw;
    }

private:
    const meshing::SurfaceMesh& surface_;
    std::mt19937 random_;

    double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
    Eigen::Vector3d gaussian() {
        std::normal_distribution<double> normal;
        const double x = normal(random_), y = normal(random_), z = normal(random_);
        return {x, y, z};
    }
    Eigen::Vector3d direction() { return gaussian().normalized(); }

    [[nodiscard]] Eigen::Vector3d twice_area(Eigen::Index t) const {
        const Eigen::Matrix3d corners = surface_.nodes(Eigen::all, surface_.triangles.col(t));
        return (corners.col(1) - corners.col(0)).cross(corners.col(2) - corners.col(0));
    }

    /// The share of the area that faces a random direction best.
    std::pair<std::vector<Eigen::Index>, std::vector<double>> patch(double share) {
        const Eigen::Vector3d towards = direction();
        std::vector<Eigen::Index> order(static_cast<std::size_t>(surface_.triangle_count()));
        std::iota(order.begin(), order.end(), Eigen::Index{0});
        const Eigen::Vector3d centre = surface_.nodes.rowwise().mean();
        const auto height = [&](Eigen::Index t) {
            return (surface_.nodes(Eigen::all, surface_.triangles.col(t)).rowwise().mean() - centre).dot(towards);
        };
        std::sort(order.begin(), order.end(), [&](auto a, auto b) { return height(a) > height(b); });
        double whole = 0, taken = 0;
        for (const Eigen::Index t : order) whole += twice_area(t).norm();
        std::vector<Eigen::Index> triangles;
        std::vector<double> areas;
        for (const Eigen::Index t : order) {
            if (taken >= share * whole) break;
            if (twice_area(t).dot(towards) <= 0) continue;  // seen from outside
            triangles.push_back(t);
            areas.push_back(twice_area(t).norm());
            taken += areas.back();
        }
        return {triangles, areas};
    }

    std::pair<Eigen::Vector3d, Eigen::Vector3d> point_on(Eigen::Index t) {
        const double root = std::sqrt(between(0, 1)), along = between(0, 1);
        const Eigen::Vector3d weights(1 - root, root * (1 - along), root * along);
        return {surface_.nodes(Eigen::all, surface_.triangles.col(t)) * weights, twice_area(t).normalized()};
    }
};

double mean_error(const Eigen::Matrix3Xd& a, const Eigen::Matrix3Xd& b) {
    return (a - b).colwise().norm().mean();
}

void print_summary(const std::string& name, const std::vector<double>& values) {
    const Summary s = summarise(values);
    std::printf("%s: mean %.2f, median %.2f, 95th %.2f, max %.2f mm\n", name.c_str(), s.mean, s.median, s.percentile_95,
                s.maximum);
}

void run(const Arguments& arguments) {
    const fs::path folder = arguments.data / arguments.folder;
    PrepareOptions prepare_options;
    prepare_options.meshing.edge_length = arguments.edge_length;
    const imaging::Volume labels = imaging::read_labels(folder / "preop_labels.nii.gz");
    if (arguments.edge_length == 0) prepare_options.meshing.edge_length = suggested_edge_length_without_labels(labels);
    const PreparedModel prepared = prepare(labels, prepare_options);
    const meshing::SurfaceMesh model = meshing::boundary_surface(prepared.model.mesh).surface;
    meshing::MeshingOptions fine;
    fine.edge_length = 6;
    const meshing::SurfaceMesh truth =
        meshing::boundary_surface(meshing::mesh_labels(imaging::read_labels(folder / "intraop_labels.nii.gz"), fine))
            .surface;
    const Landmarks landmarks = read_landmarks(folder / "landmarks.csv");
    std::vector<double> rigid_errors, errors;
    int failed = 0, failed_said = 0, doubted = 0;
    std::printf(
        "| draw | coverage (as found) | outliers | start | rigid, mm | elastic, mm | inliers | residual, mm | rival, "
        "mm | "
        "95 %% radius, mm | s | doubts |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n");
    for (int seed = arguments.first; seed < arguments.first + arguments.count; ++seed) {
        const Draw draw = Drawing(truth, static_cast<unsigned>(seed)).draw(arguments.deviation_mm, seed % 2 == 0);
        const Eigen::Matrix3Xd targets = draw.pose * landmarks.fixed;
        UpdateOptions options;
        options.surface.patch_mm = arguments.patch;
        options.tissue.load_shapes = arguments.load_shapes;
        options.device = Device::Cpu;
        const Alignment rigid = align_surfaces(model, draw.seen, options.alignment);
        rigid_errors.push_back(mean_error(rigid.placement * landmarks.moving, targets));
        const auto start = std::chrono::steady_clock::now();
        UpdateResult result = update(prepared, {.surface = draw.seen}, options);
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        const UncertaintySummary expected = summarise(uncertainty(prepared, result));
        if (const auto doubt = doubt_of_data(expected)) result.doubts.push_back(*doubt);
        errors.push_back(mean_error(PointTransform(result.deformation)(landmarks.moving), targets));
        constexpr double failure_mm = 5;
        failed += errors.back() > failure_mm;
        failed_said += errors.back() > failure_mm && !result.doubts.empty();
        doubted += !result.doubts.empty();
        std::printf(
            "| %d | %.2f (%.2f) | %.2f | %.0f°, %.0f mm | %.2f | %.2f | %.2f | %.2f | %.0f at %.2f | %.2f | %.1f |",
            seed, draw.coverage, result.surface->coverage, draw.outliers, draw.angle_deg, draw.shift_mm,
            rigid_errors.back(), errors.back(), result.surface->inlier_share, result.surface->residual_mm,
            result.surface->rival_mm, result.surface->rival_support, expected.interval_mm, seconds);
        for (const Doubt& doubt : result.doubts) std::printf(" %s;", full_text(doubt).c_str());
        std::printf(" |\n");
        std::fflush(stdout);
    }
    print_summary("rigid", rigid_errors);
    print_summary("elastic", errors);
    std::printf("beyond 5 mm: %d, of which said: %d; doubted in all: %d of %d\n", failed, failed_said, doubted,
                arguments.count);
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    try {
        run(parse(argc, argv));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "surface_redraws_bench: %s\n", error.what());
        return 2;
    }
    return 0;
}
