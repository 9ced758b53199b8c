// Registration from every kind of intraoperative data against known truth, with sweeps of one option:
//     registration_bench DATA [--case PART] [--OPTION V1,V2,…] [--mesh-edge MM] [--poisson NU] [--count POINTS]
//                        [--errors FOLDER] [--repeats N] [--device cpu|gpu|auto]
// DATA holds phantom-brainshift, phantom-brain-sag, phantom-liver, lung-ct and ultrasound, a folder of `tissuewarp
// study patient --problems ultrasound:SEED --evidence ultrasound`; PART selects cases whose name holds it. Errors are
// at the landmarks or, where there is a true field, at its points in the mask; FOLDER gets them point by point, as CSV.
// With --repeats every update runs N times, and a line per case tells the time from data in to warped image out, the
// model prepared: on the processor (the default) by warp_by_mesh(), on a GPU by GpuWarp; voxels outside the mesh follow
// the placement. Then N updates go on each from the last one, while the patient moves at random by half a millimetre
// along each axis from one to the next (but for a held head) and every tenth point of a surface is another one's; a
// second line tells their times and errors. On a processor newer than the OpenBLAS set OPENBLAS_CORETYPE, as the
// program does by itself: factors take three times as long without.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/labels.hpp"
#include "imaging/sampling.hpp"
#include "registration/evaluation.hpp"
#include "registration/field.hpp"
#include "registration/gpu_warp.hpp"
#include "registration/io/surface_points.hpp"
#include "registration/update.hpp"
#include "registration/warp.hpp"
#include "tled/blas_threads.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <random>
#include <sstream>
#include <string>

using namespace tissuewarp;
using namespace tissuewarp::registration;
namespace fs = std::filesystem;

namespace {

struct Case {
    std::string name;
    imaging::Volume moving, labels;
    Intraoperative seen;
    Landmarks targets;
    double poissons_ratio = 0.45;
    bool align = true;
};

/// Points of a field's grid in a mask, and where the field takes them.
Landmarks field_targets(const fs::path& field_path, const fs::path& mask_path) {
    const imaging::Volume field = imaging::read_volume(field_path);
    const imaging::Volume mask = imaging::read_labels(mask_path).as(CV_32F);
    const imaging::LinearSampler in_mask(mask);
    std::vector<Eigen::Vector3d> from, to;
    const auto* vector = field.data<cv::Vec3f>();
    const auto& size = field.geometry.size;
    for (int k = 0; k < size[2]; ++k)
        for (int j = 0; j < size[1]; ++j)
            for (int i = 0; i < size[0]; ++i) {
                const Eigen::Vector3d point = field.geometry.point(Eigen::Vector3d(i, j, k));
                if (!(in_mask.value(point) > 0.999F)) continue;
                const cv::Vec3f& u = vector[field.offset(i, j, k)];
                from.push_back(point);
                to.push_back(point + Eigen::Vector3d(u[0], u[1], u[2]));
            }
    Landmarks result{Eigen::Matrix3Xd(3, from.size()), Eigen::Matrix3Xd(3, from.size())};
    for (std::size_t n = 0; n < from.size(); ++n) {
        result.moving.col(static_cast<Eigen::Index>(n)) = from[n];
        result.fixed.col(static_cast<Eigen::Index>(n)) = to[n];
    }
    return result;
}

std::vector<std::function<Case()>> cases(const fs::path& data, const std::string& part) {
    std::vector<std::function<Case()>> result;
    const auto add = [&](const std::string& name, const std::function<Case()>& make) {
        if (name.find(part) == std::string::npos) return;
        result.push_back([name, make] {
            Case study = make();
            study.name = name;
            return study;
        });
    };
    const fs::path shift = data / "phantom-brainshift", sag = data / "phantom-brain-sag", lung = data / "lung-ct",
                   liver = data / "phantom-liver";
    const auto image_case = [](const fs::path& folder) {
        return [folder] {
            return Case{{},
                        imaging::read_volume(folder / "preop.nii.gz"),
                        imaging::read_labels(folder / "preop_labels.nii.gz"),
                        {.image = imaging::read_volume(folder / "intraop.nii.gz")},
                        read_landmarks(folder / "landmarks.csv")};
        };
    };
    const auto sag_case = [sag](const std::string& image) {
        return [sag, image] {
            return Case{{},
                        imaging::read_volume(sag / "preop.nii.gz"),
                        imaging::read_labels(sag / "preop_mask.nii.gz"),
                        {.image = imaging::read_volume(sag / image)},
                        field_targets(sag / "truth_forward.nii.gz", sag / "preop_mask.nii.gz")};
        };
    };
    const auto lung_case = [lung](bool masks) {
        return [lung, masks] {
            Case study{{},
                       imaging::read_volume(lung / "moving.mha"),
                       imaging::read_labels(lung / "moving_mask.mha"),
                       {.image = imaging::read_volume(lung / "fixed.mha")},
                       read_landmarks(lung / "moving_pts.txt", lung / "fixed_pts.txt"),
                       0.3};
            if (masks) study.seen.labels = imaging::read_labels(lung / "fixed_mask.mha");
            return study;
        };
    };
    /// Label maps alone.
    const auto label_case = [](const fs::path& folder, const std::string& moving, const std::string& fixed) {
        return Case{{},
                    imaging::read_volume(folder / "preop.nii.gz"),
                    imaging::read_labels(folder / moving),
                    {.labels = imaging::read_labels(folder / fixed)},
                    {}};
    };
    const auto organs_case = [label_case](const fs::path& folder) {
        return [label_case, folder] {
            Case study = label_case(folder, "preop_labels.nii.gz", "intraop_labels.nii.gz");
            study.targets = read_landmarks(folder / "landmarks.csv");
            return study;
        };
    };
    const auto surface_case = [](const fs::path& folder, double deviation_mm, bool align) {
        return [folder, deviation_mm, align] {
            Case study{{},
                       imaging::read_volume(folder / "preop.nii.gz"),
                       imaging::read_labels(folder / "preop_labels.nii.gz"),
                       {.surface = read_surface_points(folder / "intraop_surface.ply", deviation_mm)},
                       read_landmarks(folder / "landmarks.csv")};
            study.align = align;
            return study;
        };
    };
    add("liver surface", surface_case(liver, 0.7, true));
    add("brain shift surface", surface_case(shift, 0.3, false));  // the head is held: both images are in one frame
    add("brain shift image", image_case(shift));
    add("ultrasound", image_case(data / "ultrasound"));
    add("brain sag clean image", sag_case("intraop.nii.gz"));
    add("brain sag degraded image", sag_case("intraop_degraded.nii.gz"));
    add("lung image and masks", lung_case(true));
    add("lung image", lung_case(false));
    add("brain shift labels", organs_case(shift));
    add("liver labels", organs_case(liver));
    add("brain sag masks", [label_case, sag] {
        Case study = label_case(sag, "preop_mask.nii.gz", "intraop_mask.nii.gz");
        study.targets = field_targets(sag / "truth_forward.nii.gz", sag / "preop_mask.nii.gz");
        return study;
    });
    const auto lung_masks_case = [lung_case](double poissons_ratio) {
        return [lung_case, poissons_ratio] {
            Case study = lung_case(true)();
            study.seen.image.reset();
            study.poissons_ratio = poissons_ratio;
            return study;
        };
    };
    add("lung masks", lung_masks_case(0.3));
    add("lung masks, default tissue", lung_masks_case(0.45));
    return result;
}

using Setter = std::function<void(UpdateOptions&, double)>;

std::map<std::string, Setter> setters() {
    return {{"align", [](UpdateOptions& o, double v) { o.align = v != 0; }},
            {"tissue-strain", [](UpdateOptions& o, double v) { o.tissue.expected_strain = v; }},
            {"surface-patch", [](UpdateOptions& o, double v) { o.surface.patch_mm = v; }},
            {"free-motion", [](UpdateOptions& o, double v) { o.tissue.free_motion_mm = v; }},
            {"load-shapes", [](UpdateOptions& o, double v) { o.tissue.load_shapes = int(v); }},
            {"held-motion", [](UpdateOptions& o, double v) { o.tissue.held_motion_mm = v; }},
            {"surface-outliers", [](UpdateOptions& o, double v) { o.surface.outlier_deviations = v; }},
            {"expected-motion", [](UpdateOptions& o, double v) { o.image.expected_motion_mm = v; }},
            {"dense-searches", [](UpdateOptions& o, double v) { o.image.dense_coarsening.resize(std::size_t(v)); }},
            {"rounds", [](UpdateOptions& o, double v) { o.rematches = int(v); }},
            {"residual-scale", [](UpdateOptions& o, double v) { o.residual_scale_mm = v; }},
            {"least-share", [](UpdateOptions& o, double v) { o.image.matching.least_share = v; }},
            {"search-mm", [](UpdateOptions& o, double v) { o.image.matching.search_mm = v; }},
            {"tolerance", [](UpdateOptions& o, double v) { o.equilibrium.tolerance_mm = v; }},
            {"unseen-motion", [](UpdateOptions& o, double v) { o.image.unseen_motion_mm = v; }},
            {"unseen-slide", [](UpdateOptions& o, double v) { o.image.unseen_slide_mm = v; }},
            {"least-confidence", [](UpdateOptions& o, double v) { o.image.consistency.least_confidence = v; }},
            {"consistent-mm", [](UpdateOptions& o, double v) { o.image.consistency.most_residual_mm = v; }}};
}

struct Arguments {
    fs::path data, errors;
    std::string part, option;
    std::vector<double> values;
    double edge_length = 0, poissons_ratio = 0;
    int count = 5000;
    int repeats = 0;
    Device device = Device::Cpu;
};

Arguments parse(int argc, char** argv) {
    if (argc < 2 || argc % 2 == 1) throw InvalidInput("see the head of registration_bench.cpp for the arguments");
    Arguments result;
    result.data = argv[1];
    for (int n = 2; n < argc; n += 2) {
        const std::string key = argv[n], value = argv[n + 1];
        if (key == "--case") {
            result.part = value;
        } else if (key == "--mesh-edge") {
            result.edge_length = std::stod(value);
        } else if (key == "--poisson") {
            result.poissons_ratio = std::stod(value);
        } else if (key == "--errors") {
            result.errors = value;
        } else if (key == "--count") {
            result.count = std::stoi(value);
        } else if (key == "--device") {
            static const std::map<std::string, Device> devices{
                {"cpu", Device::Cpu}, {"gpu", Device::Gpu}, {"auto", Device::Auto}};
            if (!devices.contains(value)) throw InvalidInput("--device " + value + ": give cpu, gpu or auto");
            result.device = devices.at(value);
        } else if (key == "--repeats") {
            result.repeats = std::stoi(value);
        } else if (key.starts_with("--") && setters().contains(key.substr(2))) {
            result.option = key.substr(2);
            std::istringstream list(value);
            for (std::string number; std::getline(list, number, ',');) result.values.push_back(std::stod(number));
        } else {
            throw InvalidInput("unknown argument " + key + "; see the head of registration_bench.cpp");
        }
    }
    if (result.values.empty()) result.values.push_back(0);
    return result;
}

void print_row(const std::string& name, const UpdateResult& result, const Landmarks& targets, double seconds) {
    const TargetError error = target_error(targets, PointTransform(result.deformation)(targets.moving));
    const Round& last = result.rounds.back();
    int evaluations = 0;
    for (const Round& round : result.rounds) evaluations += round.force_evaluations;
    std::printf("| %s | %.2f / %.2f / %.2f | %.2f / %.2f / %.2f | %zu, %d | %d / %d | %.2f | %.2f | %.1f |\n",
                name.c_str(), error.after.mean, error.after.median, error.after.percentile_95, error.moved_after.mean,
                error.moved_after.median, error.moved_after.percentile_95, result.rounds.size(), evaluations,
                last.matched, last.interface_nodes, last.mean_residual_mm, result.min_jacobian, seconds);
    if (!result.images.empty() && result.images.front().agreement)
        std::fprintf(stderr, "  agreement of the images %.3f", *result.images.front().agreement);
    if (result.surface)
        std::fprintf(stderr, "  inliers %.3f, residual %.2f mm, coverage %.2f, rival %.1f mm %.3f",
                     result.surface->inlier_share, result.surface->residual_mm, result.surface->coverage,
                     result.surface->rival_mm, result.surface->rival_support);
    for (const StageTime& time : result.times) std::fprintf(stderr, "  %s %.2f s", time.stage.c_str(), time.seconds);
    std::fprintf(stderr, "\n");
    for (const Round& round : result.rounds)
        std::fprintf(stderr, "    matched %d of %d, residual %.3f mm, change %.3f mm, %d evaluations\n", round.matched,
                     round.interface_nodes, round.mean_residual_mm, round.largest_change_mm, round.force_evaluations);
    std::fflush(stdout);
}

void write_errors(const fs::path& file, const Deformation& deformation, const Landmarks& targets) {
    const Eigen::Matrix3Xd found = PointTransform(deformation)(targets.moving);
    std::ofstream out(file);
    out << "x,y,z,moved_mm,error_x,error_y,error_z\n";
    for (Eigen::Index n = 0; n < found.cols(); ++n) {
        const Eigen::Vector3d at = targets.moving.col(n), error = found.col(n) - targets.fixed.col(n);
        out << at[0] << ',' << at[1] << ',' << at[2] << ',' << (targets.fixed.col(n) - at).norm() << ',' << error[0]
            << ',' << error[1] << ',' << error[2] << '\n';
    }
}

/// Wall-clock and processor seconds since it was made.
class Clocks {
public:
    [[nodiscard]] double wall() const {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - wall_).count();
    }
    [[nodiscard]] double processor() const { return double(std::clock() - processor_) / CLOCKS_PER_SEC; }

private:
    std::chrono::steady_clock::time_point wall_ = std::chrono::steady_clock::now();
    std::clock_t processor_ = std::clock();
};

/// The smallest value that a share of all values does not exceed.
double percentile(std::vector<double> values, double share) {
    std::sort(values.begin(), values.end());
    const auto place = static_cast<std::size_t>(std::ceil(share * double(values.size())));
    return values[std::max<std::size_t>(place, 1) - 1];
}

/// The moving image where a deformation takes it, on the grid of the intraoperative image.
class Warper {
public:
    Warper(const std::shared_ptr<const PreparedModel>& prepared, const Case& study, Device device)
        : moving_(study.moving) {
        grid_ = study.seen.image ? study.seen.image->geometry : study.moving.geometry;
        if (device != Device::Cpu) gpu_.emplace(prepared->model.mesh, moving_.as(CV_32F), grid_);
    }

    void operator()(const Deformation& deformation) {
        if (gpu_)
            gpu_->warp(deformation.displacement, deformation.placement, warped_);
        else
            warped_ = warp_by_mesh(moving_, deformation, grid_);
    }

private:
    const imaging::Volume& moving_;
    imaging::Geometry grid_;
    std::optional<GpuWarp> gpu_;
    imaging::Volume warped_;
};

/// Times of updates, from data in to warped image out.
class UpdateTimes {
public:
    /// What an update gives, warped.
    UpdateResult time(const std::function<UpdateResult()>& update, Warper& warper) {
        const Clocks whole;
        UpdateResult result = update();
        const Clocks warp_clock;
        warper(result.deformation);
        stages_["warp"].push_back(warp_clock.wall());
        wall_.push_back(whole.wall());
        processor_.push_back(whole.processor());
        for (const StageTime& time : result.times) stages_[time.stage].push_back(time.seconds);
        return result;
    }

    void print(const std::string& name) const {
        std::printf(
            "%s, %zu updates, ms: least %.0f, median %.0f, 90th %.0f, 95th %.0f, most %.0f; processor: median %.0f\n",
            name.c_str(), wall_.size(), 1e3 * percentile(wall_, 0), 1e3 * percentile(wall_, 0.5),
            1e3 * percentile(wall_, 0.9), 1e3 * percentile(wall_, 0.95), 1e3 * percentile(wall_, 1),
            1e3 * percentile(processor_, 0.5));
        std::printf("  medians of stages, ms:");
        for (const auto& [stage, seconds] : stages_)
            std::printf("  %s %.0f", stage.c_str(), 1e3 * percentile(seconds, 0.5));
        std::printf("\n");
        std::fflush(stdout);
    }

private:
    std::vector<double> wall_, processor_;
    std::map<std::string, std::vector<double>> stages_;
};

void time_updates(const std::string& name, Updater& updater, Warper& warper, const Case& study, int repeats) {
    UpdateTimes times;
    for (int n = 0; n < repeats; ++n) times.time([&] { return updater.update(study.seen); }, warper);
    times.print(name);
}

/// What is seen while the patient moves.
class MovingPatient {
public:
    explicit MovingPatient(const Case& study) : study_(study), seen_(study.seen), held_(!study.align) {}

    const Intraoperative& next() {
        if (!held_)
            for (double& along : shift_) along += 0.5 * normal_(generator_);
        seen_ = study_.seen;
        if (seen_.labels) seen_.labels->geometry.origin += shift_;
        if (seen_.image) seen_.image->geometry.origin += shift_;
        if (seen_.surface) {
            Eigen::Matrix3Xd& points = seen_.surface->points;
            Eigen::Matrix3Xd& normals = seen_.surface->normals;
            points.colwise() += shift_;
            for (Eigen::Index n = 0; n < points.cols() / 10; ++n) {
                const auto to = Eigen::Index(generator_() % points.cols()),
                           from = Eigen::Index(generator_() % points.cols());
                points.col(to) = points.col(from);
                if (normals.cols() > 0) normals.col(to) = normals.col(from);
            }
        }
        return seen_;
    }

    /// Of a result for what was seen last.
    [[nodiscard]] double mean_error_mm(const UpdateResult& result) const {
        Landmarks targets = study_.targets;
        targets.fixed.colwise() += shift_;
        return target_error(targets, PointTransform(result.deformation)(targets.moving)).after.mean;
    }

private:
    const Case& study_;
    Intraoperative seen_;
    bool held_;
    Eigen::Vector3d shift_ = Eigen::Vector3d::Zero();
    std::mt19937_64 generator_{1};
    std::normal_distribution<double> normal_;
};

void time_going_on(const std::string& name, Updater& updater, Warper& warper, const Case& study, int repeats) {
    MovingPatient patient(study);
    UpdateResult last = updater.update(patient.next());
    double error = 0, cold_error = 0;
    int anew = 0;
    UpdateTimes times;
    for (int n = 0; n < repeats; ++n) {
        const Intraoperative& seen = patient.next();
        last = times.time([&] { return updater.go_on(last, seen); }, warper);
        error += patient.mean_error_mm(last) / repeats;
        anew += !last.beginning.at_last;
        if (!last.beginning.at_last) std::fprintf(stderr, "  began anew: %s\n", last.beginning.why.c_str());
        cold_error += patient.mean_error_mm(updater.update(seen)) / repeats;
    }
    times.print(name + ", going on");
    std::printf("  %d began anew; mean error %.3f mm, from their beginning %.3f mm\n", anew, error, cold_error);
    std::fflush(stdout);
}

void run(const Arguments& arguments) {
    std::printf(
        "| case | mean / median / 95th, mm | moved > 2 mm | rounds, evaluations | matched | residual, mm | min J | s "
        "|\n|---|---|---|---|---|---|---|---|\n");
    for (const auto& make : cases(arguments.data, arguments.part)) {
        const Case study = make();
        PrepareOptions options;
        options.meshing.edge_length = arguments.edge_length;
        if (arguments.edge_length == 0 && !study.seen.labels)
            options.meshing.edge_length = suggested_edge_length_without_labels(study.labels);
        options.default_material =
            tled::neo_hookean_lnj(3.0, arguments.poissons_ratio > 0 ? arguments.poissons_ratio : study.poissons_ratio);
        const auto model = std::make_shared<PreparedModel>(prepare(study.labels, options));
        PreparedModel& prepared = *model;
        ImageModelOptions image_options;
        image_options.features.count = arguments.count;
        if (study.seen.image)
            prepare_image(prepared, study.moving, image_options);
        else
            prepare_loads(prepared);
        for (const double value : arguments.values) {
            UpdateOptions update_options;
            update_options.device = arguments.device;
            update_options.align = study.align;
            std::string name = study.name;
            if (!arguments.option.empty()) {
                setters().at(arguments.option)(update_options, value);
                std::ostringstream text;
                text << name << ", " << arguments.option << ' ' << value;
                name = text.str();
            }
            const Clocks clocks;
            const UpdateResult result = update(prepared, study.seen, update_options);
            print_row(name, result, study.targets, clocks.wall());
            if (arguments.repeats > 0) {
                Updater updater(model, update_options);
                Warper warper(model, study, update_options.device);
                time_updates(name, updater, warper, study, arguments.repeats);
                time_going_on(name, updater, warper, study, arguments.repeats);
            }
            if (!arguments.errors.empty())
                write_errors(arguments.errors / (name + ".csv"), result.deformation, study.targets);
        }
    }
}

}  // namespace

int main(int argc, char** argv) {
    tissuewarp::tled::let_solves_take_one_blas_thread(true);
    try {
        run(parse(argc, argv));
    } catch (const std::exception& error) {
        std::fprintf(stderr, "registration_bench: %s\n", error.what());
        return 2;
    }
    return 0;
}
