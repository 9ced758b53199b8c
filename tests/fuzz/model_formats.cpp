// The program's own HDF5: records of a registration and prepared models.

#include "registration/prepared/patient_io.hpp"
#include "registration/prepared/prepared_io.hpp"
#include "registration/record.hpp"
#include "tests/fuzz/format.hpp"
#include "tests/fuzz/hdf5_edits.hpp"
#include "tests/registration/shapes.hpp"

namespace tissuewarp::fuzz {

namespace {

using namespace registration;

PreparedModel prepared_box() {
    meshing::TetMesh mesh = test::box_at({-15, -10, -10}, {30, 20, 20}, {3, 2, 2}, 0.1);
    imaging::Volume labels(test::oblique_grid({0, 0, 0}, {12, 10, 9}, {4, 4, 4}), CV_32SC1);
    test::for_each_voxel(labels, [&](const Eigen::Vector3d& index, std::int64_t offset) {
        const Eigen::Vector3d p = labels.geometry.point(index);
        labels.data<int>()[offset] = (p.cwiseAbs().array() < Eigen::Array3d(15, 10, 10)).all() ? 1 : 0;
    });
    PreparedModel prepared = prepare(std::move(mesh), labels);
    prepared.times.clear();
    return prepared;
}

/// Sealed as they are written, and as older versions wrote them.
std::vector<Seed> all_kinds(const std::filesystem::path& folder, const std::string& name) {
    copy_without_seal(folder / name, folder / ("old_" + name), false);
    return {single(name, bytes_at(folder / name)), single("old_" + name, bytes_at(folder / ("old_" + name)))};
}

std::vector<Seed> record_seeds(const std::filesystem::path& folder) {
    const PreparedModel prepared = prepared_box();
    UpdateResult result;
    result.deformation = test::deformed_by(prepared.model.mesh,
                                           [](const Eigen::Vector3d& p) { return Eigen::Vector3d(0.1 * p[0], 0, 0); });
    result.deformation.placement = test::motion(12.0, {1, 2, 3}, {4.0, -5.5, 1.0});
    result.rounds = {{15.0, 120, 150, 11, 1.25, 6.0, 900, 0.04}};
    result.engine = "CPU";
    write_record(prepared, result, {{{"device", "CPU"}, {"seed", ""}}, "[meshing]\nedge_length = 5.0\n"},
                 folder / "record.h5");
    return all_kinds(folder, "record.h5");
}

std::vector<Seed> prepared_seeds(const std::filesystem::path& folder) {
    write_prepared(prepared_box(), folder / "prepared.h5");
    return all_kinds(folder, "prepared.h5");
}

std::vector<Seed> patient_seeds(const std::filesystem::path& folder) {
    imaging::Volume image(test::oblique_grid({0, 0, 0}, {12, 10, 9}, {4, 4, 4}), CV_16SC1);
    image.voxels.setTo(7);
    write_patient(prepared_box(), image, R"({"facts_version": 1})", folder / "patient.tw");
    return all_kinds(folder, "patient.tw");
}

void read_the_record(const std::filesystem::path& path, Digest& digest) {
    const Record record = read_record(path);
    digest.matrix(record.deformation.mesh.nodes);
    digest.matrix(record.deformation.mesh.tets);
    digest.matrix(record.deformation.mesh.labels);
    digest.matrix(record.deformation.displacement);
    digest.matrix(record.jacobian);
    for (const auto& [name, value] : record.provenance) digest.text(name + value);
    digest.text(record.parameters_toml);
}

void read_the_prepared_model(const std::filesystem::path& path, Digest& digest) {
    const PreparedModel prepared = read_prepared(path);
    digest.matrix(prepared.model.mesh.nodes);
    digest.matrix(prepared.model.mesh.tets);
    digest.voxels(prepared.labels.voxels);
    digest.number(prepared.options.data_stiffness);
    digest.number(prepared.options.meshing.edge_length);
}

void read_the_patient(const std::filesystem::path& path, Digest& digest) {
    const Patient patient = read_patient(path);
    digest.matrix(patient.prepared.model.mesh.nodes);
    digest.voxels(patient.labels.voxels);
    if (!patient.image.empty()) digest.voxels(patient.image.voxels);
    digest.text(patient.facts);
}

}  // namespace

std::vector<Format> model_formats() {
    return {{"record", record_seeds, read_the_record, {}, edit_hdf5},
            {"prepared", prepared_seeds, read_the_prepared_model, {}, edit_hdf5},
            {"patient", patient_seeds, read_the_patient, {}, edit_hdf5}};
}

}  // namespace tissuewarp::fuzz
