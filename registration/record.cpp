#include "registration/record.hpp"

#include "registration/io/stored_model.hpp"

#include "core/atomic_file.hpp"
#include "core/file_message.hpp"

#include <algorithm>
#include <cstdint>
#include <optional>

namespace tissuewarp::registration {

namespace {

constexpr const char* format = "tissuewarp registration record";
constexpr int version = 5, oldest_version = 1;
constexpr const char* resected = "resected";                   // absent where no tissue is gone
constexpr const char* slide = "surroundings/slide";            // absent where they do not
constexpr const char* values_of_runs = "surroundings/values";  // absent where no body moved on its own

std::string body_name(std::size_t n) {
    return "surroundings/body " + std::to_string(n);
}

/// The version to write: older programs would leave no gap, drag along what the organ slid along, or leave bones with
/// it that moved on their own, and read everything else.
int version_of(const PreparedModel& prepared, const Deformation& deformation) {
    constexpr int before_resection = 2, before_sliding = 3, before_bodies = 4;
    if (deformation.surroundings && !deformation.surroundings->bodies.empty()) return version;
    if (deformation.surroundings && deformation.surroundings->slide) return before_bodies;
    return prepared.resected.empty() ? before_resection : before_sliding;
}

/// det F of every tetrahedron; the placement is rigid and has no part in it.
Eigen::VectorXd jacobians(const Deformation& deformation) {
    const meshing::TetMesh& mesh = deformation.mesh;
    const meshing::TetMesh deformed{mesh.nodes + deformation.displacement, mesh.tets, mesh.labels};
    return meshing::tet_volumes(deformed).cwiseQuotient(meshing::tet_volumes(mesh));
}

void require_rigid(const Eigen::Matrix4d& motion, const std::string& name) {
    const Eigen::Matrix3d rotation = motion.topLeftCorner<3, 3>();
    const double error = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
    constexpr double rounding = 1e-6;
    if (!motion.allFinite() || !(error <= rounding) || rotation.determinant() < 0 ||
        motion.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
        throw InvalidInput(name + " is not a rigid motion (rotation off by " + std::to_string(error) +
                           ", at most 1e-6)");
}

void require_consistent(const Deformation& deformation) {
    if (deformation.displacement.cols() != deformation.mesh.nodes.cols())
        throw InvalidInput("a displacement of " + std::to_string(deformation.displacement.cols()) +
                           " nodes does not belong to a mesh of " + std::to_string(deformation.mesh.node_count()));
    if (!deformation.displacement.allFinite()) throw InvalidInput("the displacement holds values that are not finite");
    require_rigid(deformation.placement.matrix(), "the placement");
    if (deformation.surroundings)
        require_rigid(deformation.surroundings->motion.matrix(), "the motion of the surroundings");
    if (deformation.surroundings)
        for (const Eigen::Isometry3d& motion : deformation.surroundings->bodies)
            require_rigid(motion.matrix(), "the motion of a rigid neighbour");
}

void write_matrix(Hdf5Output& file, const std::string& name, const Eigen::Isometry3d& motion) {
    file.columns<double>(name, motion.matrix().transpose(), "mm");
    file.attribute(name, "meaning", "homogeneous matrix, moving to fixed, LPS mm: y = A x");
}

Eigen::Isometry3d read_matrix(const Hdf5Input& file, const std::string& name) {
    Eigen::Matrix4d rows;
    file.array<double>(name, rows.data(), {4, 4});
    Eigen::Isometry3d motion;
    motion.matrix() = rows.transpose();
    return motion;
}

/// The mask as lengths of runs of one value in the order of memory. Without bodies of their own motion 0 and 1 take
/// turns, beginning with 0; otherwise values are stored besides.
void write_surroundings(Hdf5Output& file, const Surroundings& surroundings) {
    write_matrix(file, "surroundings/motion", surroundings.motion);
    detail::write_grid(file, "surroundings/grid", surroundings.rigid.geometry);
    if (surroundings.slide) file.scalar<int>(slide, 1, "1");
    const auto* voxel = surroundings.rigid.data<std::uint8_t>();
    const std::int64_t count = surroundings.rigid.geometry.voxel_count();
    const bool with_bodies = !surroundings.bodies.empty();
    std::vector<int> runs, values;
    for (std::int64_t from = 0; from < count || runs.empty();) {
        const bool first_of_turns = !with_bodies && runs.empty();
        const int value = first_of_turns ? 0 : voxel[from];
        std::int64_t to = from;
        while (to < count && voxel[to] == value) ++to;
        runs.push_back(static_cast<int>(to - from));
        values.push_back(value);
        from = to;
    }
    const auto column = [&](const char* name, const std::vector<int>& numbers, const char* units) {
        file.vector<int>(name, Eigen::VectorXi::Map(numbers.data(), static_cast<Eigen::Index>(numbers.size())), units);
    };
    column("surroundings/runs", runs, "voxel");
    if (!with_bodies) return;
    column(values_of_runs, values, "1");
    for (std::size_t n = 0; n < surroundings.bodies.size(); ++n)
        write_matrix(file, body_name(n), surroundings.bodies[n]);
}

std::optional<Surroundings> read_surroundings(const Hdf5Input& file) {
    if (!file.holds("surroundings/runs")) return std::nullopt;
    Surroundings surroundings{read_matrix(file, "surroundings/motion"),
                              imaging::Volume(detail::read_grid(file, "surroundings/grid"), CV_8UC1),
                              file.holds(slide)};
    while (file.holds(body_name(surroundings.bodies.size())))
        surroundings.bodies.push_back(read_matrix(file, body_name(surroundings.bodies.size())));
    const auto refuse = [] {
        throw InvalidInput("the runs of the surroundings' mask do not fill its grid; the file is damaged");
    };
    const auto runs = file.vector<int>("surroundings/runs");
    Eigen::VectorXi values(runs.size());
    for (Eigen::Index n = 0; n < values.size(); ++n) values[n] = static_cast<int>(n % 2);
    if (!surroundings.bodies.empty()) values = file.vector<int>(values_of_runs);
    if (values.size() != runs.size()) refuse();
    auto* voxel = surroundings.rigid.data<std::uint8_t>();
    const std::int64_t count = surroundings.rigid.geometry.voxel_count();
    std::int64_t at = 0;
    for (Eigen::Index n = 0; n < runs.size(); ++n) {
        if (runs[n] < 0 || runs[n] > count - at || values[n] < 0 ||
            values[n] > 1 + static_cast<int>(surroundings.bodies.size()))
            refuse();
        std::fill_n(voxel + at, runs[n], static_cast<std::uint8_t>(values[n]));
        at += runs[n];
    }
    if (at != count) refuse();
    return surroundings;
}

void write_rounds(Hdf5Output& file, const std::vector<Round>& rounds) {
    const auto column = [&](const std::string& name, auto member, const std::string& units) {
        using Value = std::decay_t<decltype(rounds[0].*member)>;
        Eigen::Matrix<Value, Eigen::Dynamic, 1> values(static_cast<Eigen::Index>(rounds.size()));
        std::transform(rounds.begin(), rounds.end(), values.begin(), [&](const Round& r) { return r.*member; });
        file.vector<Value>("rounds/" + name, values, units);
    };
    column("range_mm", &Round::range_mm, "mm");
    column("matched", &Round::matched, "1");
    column("interface_nodes", &Round::interface_nodes, "1");
    column("held_back", &Round::held_back, "1");
    column("mean_residual_mm", &Round::mean_residual_mm, "mm");
    column("largest_change_mm", &Round::largest_change_mm, "mm");
    column("force_evaluations", &Round::force_evaluations, "1");
    column("estimated_error_mm", &Round::estimated_error_mm, "mm");
}

void write_info(Hdf5Output& file, const RecordInfo& info) {
    std::vector<std::string> names, values;
    for (const auto& [name, value] : info.provenance) {
        names.push_back(name);
        values.push_back(value);
    }
    file.texts("provenance/name", names);
    file.texts("provenance/value", values);
    file.texts("parameters_toml", {info.parameters_toml});
}

void write_result(Hdf5Output& file, const UpdateResult& result) {
    const Deformation& deformation = result.deformation;
    file.columns<double>("displacement", deformation.displacement, "mm");
    file.attribute("displacement", "frame", "moving image, LPS; elastic part, before the placement");
    write_matrix(file, "placement", deformation.placement);
    if (deformation.surroundings) write_surroundings(file, *deformation.surroundings);
    file.vector<double>("jacobian", jacobians(deformation), "1");
    write_matrix(file, "alignment/matrix", result.alignment.placement);
    file.scalar<double>("alignment/mean_distance_mm", result.alignment.mean_distance_mm, "mm");
    write_rounds(file, result.rounds);
    if (!result.rounds.empty())
        file.scalar<double>("estimated_error_mm", result.rounds.back().estimated_error_mm, "mm");
    if (result.contact) {
        file.scalar<int>("contact/touching", result.contact->touching, "1");
        file.scalar<double>("contact/deepest_mm", result.contact->deepest_mm, "mm");
    }
    if (result.anchors) {
        file.scalar<int>("anchors/nodes", result.anchors->nodes, "1");
        file.scalar<double>("anchors/largest_mm", result.anchors->largest_mm, "mm");
    }
    file.texts("engine", {result.engine});
    file.texts("doubts", texts(result.doubts));
}

}  // namespace

void write_record(const PreparedModel& prepared, const UpdateResult& result, const RecordInfo& info,
                  const std::filesystem::path& path) {
    const Deformation& deformation = result.deformation;
    require_consistent(deformation);
    if (deformation.mesh.tets != prepared.model.mesh.tets || deformation.mesh.nodes != prepared.model.mesh.nodes)
        throw InvalidInput("the result's mesh is not the prepared model's; pass the model that was updated");
    AtomicFile target(path);
    Hdf5Output file(target.path(), format, version_of(prepared, deformation));
    detail::write_model(file, prepared.model);
    detail::write_grid(file, "moving_grid", prepared.labels.geometry);
    if (!prepared.resected.empty()) detail::write_label_map(file, resected, prepared.resected);
    write_result(file, result);
    detail::write_stages(file, "stages/prepare", prepared.times);
    detail::write_stages(file, "stages/update", result.times);
    write_info(file, info);
    file.close();
    target.commit();
}

namespace {

Record read_checked(const std::filesystem::path& path) {
    const Hdf5Input file(path, format, version, oldest_version);
    Record record;
    record.format_version = file.version();
    tled::Model model = detail::read_model(file);
    record.materials = std::move(model.materials);
    record.element = model.element;
    record.deformation.mesh = std::move(model.mesh);
    record.deformation.displacement = file.columns<double>("displacement", 3);
    record.deformation.placement = read_matrix(file, "placement");
    record.deformation.surroundings = read_surroundings(file);
    require_consistent(record.deformation);
    record.jacobian = file.vector<double>("jacobian", record.deformation.mesh.tet_count());
    record.moving_grid = detail::read_grid(file, "moving_grid");
    if (file.holds(resected)) record.resected = detail::read_label_map(file, resected);
    const std::vector<std::string> names = file.texts("provenance/name"), values = file.texts("provenance/value");
    if (names.size() != values.size())
        throw InvalidInput("'" + path.string() + "' holds " + std::to_string(names.size()) +
                           " names of provenance for " + std::to_string(values.size()) + " values");
    for (std::size_t row = 0; row < names.size(); ++row) record.provenance[names[row]] = values[row];
    record.parameters_toml = file.text("parameters_toml");
    return record;
}

}  // namespace

Record read_record(const std::filesystem::path& path) {
    return naming(path, [&] { return read_checked(path); });
}

}  // namespace tissuewarp::registration
