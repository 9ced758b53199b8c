// Prints the tables of docs/lab/results.md, section "Block matching": blocks of the moving image found in the bare fixed
// image, against the true displacement of the phantoms and the landmarks of the lung.
//     image_matching_bench DATA [--case PART] [--csv FILE] [--count POINTS] [--grid MM] [--radius VOXELS]
// DATA holds phantom-brainshift, phantom-brain-sag and lung-ct; PART selects cases whose name holds it; FILE takes a
// line per match found.

#include "core/errors.hpp"
#include "imaging/filters.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"
#include "registration/evaluation.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/pose/alignment.hpp"
#include "tled/blas_threads.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

using namespace tissuewarp;
using namespace tissuewarp::registration;
namespace fs = std::filesystem;

namespace {

/// A displacement field, sampled.
class Field {
public:
    explicit Field(const imaging::Volume& field) {
        std::vector<cv::Mat> channels(3);
        for (int c = 0; c < 3; ++c) {
            imaging::Volume component(field.geometry, CV_32FC1);
            const auto* vector = field.data<cv::Vec3f>();
            for (std::int64_t n = 0; n < field.geometry.voxel_count(); ++n) component.data<float>()[n] = vector[n][c];
            components_.emplace_back(component);
        }
    }
    [[nodiscard]] Eigen::Vector3d operator()(const Eigen::Vector3d& point) const {
        return {components_[0].value(point), components_[1].value(point), components_[2].value(point)};
    }

private:
    std::vector<imaging::LinearSampler> components_;
};

struct Arguments {
    fs::path data, csv;
    std::string part;
    FeatureOptions features;
    TemplateOptions matching;
};

Arguments parse(int argc, char** argv) {
    if (argc < 2 || argc % 2 == 1) throw InvalidInput("see the head of image_matching_bench.cpp for the arguments");
    Arguments result{argv[1], {}, {}, {}, {}};
    for (int n = 2; n < argc; n += 2) {
        const std::string key = argv[n], value = argv[n + 1];
        if (key == "--case") {
            result.part = value;
        } else if (key == "--csv") {
            result.csv = value;
        } else if (key == "--count") {
            result.features.count = std::stoi(value);
        } else if (key == "--grid") {
            result.matching.grid_spacing_mm = std::stod(value);
        } else if (key == "--radius") {
            result.matching.block_radius = std::stoi(value);
        } else {
            throw InvalidInput("unknown argument " + key + "; see the head of image_matching_bench.cpp");
        }
    }
    return result;
}

struct Case {
    std::string name;
    imaging::Volume moving, mask, fixed;
    Eigen::Isometry3d placement = Eigen::Isometry3d::Identity();
};

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

/// Seconds that all threads have worked: on busy cores the better measure.
double cpu_seconds() {
    return double(std::clock()) / CLOCKS_PER_SEC;
}

double quantile(std::vector<double> values, double share) {
    if (values.empty()) return std::nan("");
    const auto n = static_cast<std::ptrdiff_t>(share * double(values.size() - 1) + 0.5);
    std::nth_element(values.begin(), values.begin() + n, values.end());
    return values[static_cast<std::size_t>(n)];
}

struct Errors {
    std::vector<double> full, informative, squared, deviation;  // mm, mm, eᵀ I e, det(I)^(−1/6) mm

    void add(const BlockMatch& match, const Eigen::Vector3d& truth) {
        const Eigen::Vector3d e = match.fixed - truth;
        const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes(match.information);
        full.push_back(e.norm());
        informative.push_back(std::abs(axes.eigenvectors().col(2).dot(e)));
        squared.push_back(e.dot(match.information * e));
        deviation.push_back(std::pow(std::max(match.information.determinant(), 0.0), -1.0 / 6));
    }
    void print_row(const std::string& name, std::size_t points, double seconds) const {
        const auto outliers =
            static_cast<double>(std::count_if(full.begin(), full.end(), [](double e) { return e > 3; }));
        std::printf("| %s | %zu / %zu | %.2f / %.2f | %.2f / %.2f | %.1f | %.2f / %.1f | %.2f | %.1f |\n", name.c_str(),
                    full.size(), points, quantile(informative, 0.5), quantile(informative, 0.9), quantile(full, 0.5),
                    quantile(full, 0.9), 100 * outliers / double(std::max<std::size_t>(full.size(), 1)),
                    quantile(squared, 0.5), quantile(squared, 0.9), quantile(deviation, 0.5), seconds);
        std::fflush(stdout);
    }
};

struct Found {
    Eigen::Index points = 0;
    std::vector<BlockMatch> all, kept;
    double seconds = 0;
};

Found find(const Case& study, const Arguments& arguments) {
    const auto start = std::chrono::steady_clock::now();
    const FeaturePoints features = select_feature_points(study.moving, study.mask, arguments.features);
    const double selected = seconds_since(start);
    Found found{features.points.cols(), {}, {}, 0};
    const MatchingTemplate prepared(study.moving, features.points, arguments.matching);
    const double before = seconds_since(start), cpu_before = cpu_seconds();
    BlockMatchingOptions options;
    options.rotation = study.placement.linear();
    found.all = match_blocks(prepared, study.fixed, study.placement * features.points, options);
    const double matched = seconds_since(start), cpu_matched = cpu_seconds();
    found.kept = consistent_matches(found.all);
    found.seconds = seconds_since(start) - before;
    std::fprintf(stderr, "%s: points %.2f s, template %.2f s; match %.2f s (%.2f s of all cores), filter %.2f s\n",
                 study.name.c_str(), selected, before - selected, matched - before, cpu_matched - cpu_before,
                 found.seconds - (matched - before));
    return found;
}

void print_head() {
    std::printf(
        "| case | kept / points | informative direction: median / 90th, mm | full: median / 90th, mm | beyond 3 mm, %% "
        "| "
        "eᵀIe: median / 90th | stated deviation: median, mm | seconds |\n|---|---|---|---|---|---|---|---|\n");
}

void write_csv(const fs::path& path, const std::string& name, const BlockMatch& match, const Eigen::Vector3d& truth) {
    if (path.empty()) return;
    std::ofstream csv(path, std::ios::app);
    const Eigen::Vector3d strength =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(match.information, Eigen::EigenvaluesOnly).eigenvalues();
    csv << name << ',' << match.moving.transpose() << ',' << match.fixed.transpose() << ',' << truth.transpose() << ','
        << match.cost << ',' << match.uniqueness << ',' << match.back_match_mm << ',' << match.confidence << ','
        << strength.transpose() << '\n';
}

void against_field(const Case& study, const Field& truth, const Arguments& arguments) {
    const Found found = find(study, arguments);
    Errors all, kept;
    const auto true_place = [&](const BlockMatch& match) -> Eigen::Vector3d {
        return match.moving + truth(match.moving);
    };
    for (const BlockMatch& match : found.all) {
        all.add(match, true_place(match));
        write_csv(arguments.csv, study.name, match, true_place(match));
    }
    for (const BlockMatch& match : found.kept) kept.add(match, true_place(match));
    const auto points = static_cast<std::size_t>(found.points);
    all.print_row(study.name + ", all found", points, found.seconds);
    kept.print_row(study.name + ", consistent", points, found.seconds);
}

/// At each landmark, the displacement of the match nearest to it.
void against_landmarks(const Case& study, const Landmarks& landmarks, const Arguments& arguments) {
    const Found found = find(study, arguments);
    Errors errors;
    std::vector<double> distances;
    for (Eigen::Index n = 0; n < landmarks.moving.cols(); ++n) {
        const auto nearest =
            std::min_element(found.kept.begin(), found.kept.end(), [&](const BlockMatch& a, const BlockMatch& b) {
                return (a.moving - landmarks.moving.col(n)).norm() < (b.moving - landmarks.moving.col(n)).norm();
            });
        if (nearest == found.kept.end()) continue;
        distances.push_back((nearest->moving - landmarks.moving.col(n)).norm());
        errors.add(*nearest, nearest->moving + landmarks.fixed.col(n) - landmarks.moving.col(n));
    }
    errors.print_row(study.name + ", nearest to " + std::to_string(errors.full.size()) + " landmarks (" +
                         std::to_string(found.kept.size()) + " kept)",
                     static_cast<std::size_t>(found.points), found.seconds);
    std::fprintf(stderr, "the nearest match lies %.1f mm from its landmark (median)\n", quantile(distances, 0.5));
}

void brain_shift(const Arguments& arguments, const std::string& name) {
    const fs::path folder = arguments.data / "phantom-brainshift";
    against_field({name, imaging::read_volume(folder / "preop.nii.gz"),
                   imaging::mask_of_all(imaging::read_labels(folder / "preop_labels.nii.gz")),
                   imaging::read_volume(folder / "intraop.nii.gz")},
                  Field(imaging::read_volume(folder / "truth_forward.nii.gz")), arguments);
}

void brain_sag(const Arguments& arguments, const std::string& name, const std::string& volume) {
    const fs::path folder = arguments.data / "phantom-brain-sag";
    against_field({name, imaging::read_volume(folder / "preop.nii.gz"),
                   imaging::read_labels(folder / "preop_mask.nii.gz"), imaging::read_volume(folder / volume)},
                  Field(imaging::read_volume(folder / "truth_forward.nii.gz")), arguments);
}

/// From the pose that the masks give.
void lung(const Arguments& arguments, const std::string& name) {
    const fs::path folder = arguments.data / "lung-ct";
    const imaging::Volume mask = imaging::read_labels(folder / "moving_mask.mha");
    const auto pose = align_labels(mask, imaging::read_labels(folder / "fixed_mask.mha")).placement;
    against_landmarks(
        {name, imaging::read_volume(folder / "moving.mha"), mask, imaging::read_volume(folder / "fixed.mha"), pose},
        read_landmarks(folder / "moving_pts.txt", folder / "fixed_pts.txt"), arguments);
}

void run(const Arguments& arguments) {
    print_head();
    const auto chosen = [&](const std::string& name) { return name.find(arguments.part) != std::string::npos; };
    if (chosen("brain shift")) brain_shift(arguments, "brain shift");
    if (chosen("brain sag clean")) brain_sag(arguments, "brain sag clean", "intraop.nii.gz");
    if (chosen("brain sag degraded")) brain_sag(arguments, "brain sag degraded", "intraop_degraded.nii.gz");
    if (chosen("lung")) lung(arguments, "lung");
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    try {
        run(parse(argc, argv));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "image_matching_bench: %s\n", error.what());
        return 2;
    }
    return 0;
}
