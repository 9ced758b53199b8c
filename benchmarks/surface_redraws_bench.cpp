// Registration from random parts of a surface: distribution of errors, and what the program says of its failures.
//     surface_redraws_bench DATA [--count N] [--first SEED] [--folder NAME] [--organs LABELS] [--deviation MM]
//                           [--mesh-edge MM] [--surface-patch MM] [--load-shapes N]
// DATA/NAME (phantom-liver by default) holds preop_labels, intraop_labels and landmarks. A draw takes 10 to 60 % of the
// true intraoperative boundary that faces a random direction, 3000 points with noise, 0 to 30 % of them 5 to 25 mm off
// in random directions, normals in every second draw, and turns and shifts all by up to 30° and 40 mm.
// With --organs, each draw is a random organ of DATA/LABELS instead (study::random_phantom): bent by a smooth map that
// conserves volume, 25 to 50 % of its surface seen, without normals, 3 % of the points up to 15 mm off as in the
// study and 5 % more 5 to 25 mm off, turned and shifted alike.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "meshing/mesher.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/pose/alignment.hpp"
#include "registration/uncertainty.hpp"
#include "registration/update.hpp"
#include "study/phantom.hpp"
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
    std::string folder = "phantom-liver", organs = {};
    int count = 50, first = 1, load_shapes = TissuePrior{}.load_shapes;
    double deviation_mm = 0.7, edge_length = 0, patch = SurfaceOptions{}.patch_mm;
};

Arguments parse(int argc, char** argv) {
    if (argc < 2 || argc % 2 == 1) throw InvalidInput("see the head of surface_redraws_bench.cpp for the arguments");
    Arguments result{.data = argv[1]};
    for (int n = 2; n < argc; n += 2) {
        const std::string key = argv[n], value = argv[n + 1];
        if (key == "--count")
            result.count = std::stoi(value);
        else if (key == "--first")
            result.first = std::stoi(value);
        else if (key == "--folder")
            result.folder = value;
        else if (key == "--organs")
            result.organs = value;
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

constexpr double most_angle_deg = 30, most_shift_mm = 40, least_outlier_mm = 5, most_outlier_mm = 25;

/// What is seen of an organ, and where its landmarks lie by then.
struct Draw {
    std::string story;
    SurfacePoints seen;
    Landmarks landmarks;
};

class Drawing {
public:
    Drawing(const meshing::SurfaceMesh& surface, unsigned seed) : surface_(surface), random_(seed) {}

    Draw draw(const Landmarks& landmarks, double deviation_mm, bool with_normals) {
        constexpr Eigen::Index count = 3000;
        Draw draw;
        const double coverage = between(0.1, 0.6), outliers = between(0.0, 0.3), angle_deg = between(0, most_angle_deg),
                     shift_mm = between(0, most_shift_mm);
        char text[100];
        std::snprintf(text, sizeof text, "%.0f %% seen, %.0f %% outliers, %.0f°, %.0f mm", 100 * coverage,
                      100 * outliers, angle_deg, shift_mm);
        draw.story = text;
        const Eigen::Vector3d centre = surface_.nodes.rowwise().mean();
        const Eigen::Isometry3d pose = Eigen::Translation3d(centre + shift_mm * direction()) *
                                       Eigen::AngleAxisd(angle_deg * EIGEN_PI / 180, direction()) *
                                       Eigen::Translation3d(-centre);
        const auto [triangles, areas] = patch(coverage);
        std::discrete_distribution<std::size_t> triangle(areas.begin(), areas.end());
        draw.seen.deviation_mm = deviation_mm;
        draw.seen.points.resize(3, count);
        Eigen::Matrix3Xd normals(3, count);
        for (Eigen::Index n = 0; n < count; ++n) {
            const auto [point, normal] = point_on(triangles[triangle(random_)]);
            Eigen::Vector3d seen = point + deviation_mm * gaussian();
            if (between(0, 1) < outliers) seen += between(least_outlier_mm, most_outlier_mm) * direction();
            draw.seen.points.col(n) = pose * seen;
            normals.col(n) = pose.linear() * (normal + 0.1 * gaussian()).normalized();
        }
        if (with_normals) draw.seen.normals = normals;
        draw.landmarks = {landmarks.moving, pose * landmarks.fixed};
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

/// One point in twenty off in a random direction.
void add_outliers(Eigen::Matrix3Xd& points, unsigned seed) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> chance(0, 1), distance_mm(least_outlier_mm, most_outlier_mm);
    for (Eigen::Index n = 0; n < points.cols(); ++n) {
        const double x = normal(random), y = normal(random), z = normal(random);
        if (chance(random) < 0.05) points.col(n) += distance_mm(random) * Eigen::Vector3d(x, y, z).normalized();
    }
}

PreparedModel prepared_from(const imaging::Volume& labels, const Arguments& arguments) {
    PrepareOptions options;
    options.meshing.edge_length =
        arguments.edge_length > 0 ? arguments.edge_length : suggested_edge_length_without_labels(labels);
    return prepare(labels, options);
}

/// Registers draws, prints a row for each, and sums them up.
class Report {
public:
    explicit Report(const Arguments& arguments) {
        options_.surface.patch_mm = arguments.patch;
        options_.tissue.load_shapes = arguments.load_shapes;
        options_.device = Device::Cpu;
        std::printf("| draw | what | found | rigid, mm | elastic, mm | inliers | residual, mm | rival, mm ");
        std::printf("| 95 %% radius, mm | s | doubts |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
    }

    void add(int seed, const PreparedModel& prepared, const Draw& draw) {
        const auto& [moving, targets] = draw.landmarks;
        const meshing::SurfaceMesh model = meshing::boundary_surface(prepared.model.mesh).surface;
        rigid_.push_back(mean_error(align_surfaces(model, draw.seen, options_.alignment).placement * moving, targets));
        const auto start = std::chrono::steady_clock::now();
        UpdateResult result = update(prepared, {.surface = draw.seen}, options_);
        const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        const UncertaintySummary expected = summarise(uncertainty(prepared, result));
        if (const auto doubt = doubt_of_data(expected)) result.doubts.push_back(*doubt);
        elastic_.push_back(mean_error(PointTransform(result.deformation)(moving), targets));
        constexpr double failure_mm = 5;
        const bool failed = elastic_.back() > failure_mm;
        const bool doubted = std::any_of(result.doubts.begin(), result.doubts.end(),
                                         [](const Doubt& doubt) { return doubt.severity == Severity::Doubt; });
        failed_ += failed;
        failed_doubted_ += failed && doubted;
        good_doubted_ += !failed && doubted;
        std::printf("| %d | %s | %.2f | %.2f | %.2f | %.2f | %.2f | %.0f at %.2f | %.2f | %.1f |", seed,
                    draw.story.c_str(), result.surface->coverage, rigid_.back(), elastic_.back(),
                    result.surface->inlier_share, result.surface->residual_mm, result.surface->rival_mm,
                    result.surface->rival_support, expected.interval_mm, seconds);
        for (const Doubt& doubt : result.doubts)
            std::printf(" %s%s;", doubt.code.c_str(), doubt.severity == Severity::Doubt ? "" : " (a notice)");
        std::printf(" |\n");
        std::fflush(stdout);
    }

    void print_summary() const {
        print("rigid", rigid_);
        print("elastic", elastic_);
        std::printf("beyond 5 mm: %d of %zu, of which doubted: %d; of the others doubted: %d\n", failed_,
                    elastic_.size(), failed_doubted_, good_doubted_);
    }

private:
    UpdateOptions options_;
    std::vector<double> rigid_, elastic_;  // mean over an organ's landmarks, mm
    int failed_ = 0, failed_doubted_ = 0, good_doubted_ = 0;

    static void print(const std::string& name, const std::vector<double>& values) {
        const Summary s = summarise(values);
        std::printf("%s: mean %.2f, median %.2f, 95th %.2f, max %.2f mm\n", name.c_str(), s.mean, s.median,
                    s.percentile_95, s.maximum);
    }
};

/// Parts of the surface of one organ.
void redraw(const Arguments& arguments, Report& report) {
    const fs::path folder = arguments.data / arguments.folder;
    const PreparedModel prepared = prepared_from(imaging::read_labels(folder / "preop_labels.nii.gz"), arguments);
    meshing::MeshingOptions fine;
    fine.edge_length = 6;
    const meshing::SurfaceMesh truth =
        meshing::boundary_surface(meshing::mesh_labels(imaging::read_labels(folder / "intraop_labels.nii.gz"), fine))
            .surface;
    const Landmarks landmarks = read_landmarks(folder / "landmarks.csv");
    for (int seed = arguments.first; seed < arguments.first + arguments.count; ++seed)
        report.add(seed, prepared,
                   Drawing(truth, static_cast<unsigned>(seed)).draw(landmarks, arguments.deviation_mm, seed % 2 == 0));
}

/// Parts of the surfaces of random organs of a label map.
void draw_organs(const Arguments& arguments, Report& report) {
    study::PhantomOptions options;
    options.family = study::Family::Labelled;
    options.organs = imaging::read_labels(arguments.data / arguments.organs);
    options.point_deviation_mm = arguments.deviation_mm;
    options.misplacement = study::Misplacement{most_angle_deg, most_shift_mm};
    for (int seed = arguments.first; seed < arguments.first + arguments.count; ++seed) {
        const study::Phantom phantom = study::random_phantom(static_cast<std::uint64_t>(seed), options);
        Draw draw{phantom.story, phantom.surface, phantom.targets};
        draw.seen.normals.resize(3, 0);
        add_outliers(draw.seen.points, static_cast<unsigned>(seed));
        report.add(seed, prepared_from(imaging::mask_of_all(phantom.moving_labels).as(CV_32S), arguments), draw);
    }
}

void run(const Arguments& arguments) {
    Report report(arguments);
    arguments.organs.empty() ? redraw(arguments, report) : draw_organs(arguments, report);
    report.print_summary();
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
