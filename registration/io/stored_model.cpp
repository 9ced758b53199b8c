#include "registration/io/stored_model.hpp"

#include "core/errors.hpp"

namespace tissuewarp::registration::detail {

namespace {

constexpr const char* element_names[] = {"T4", "AveragedPressureT4"};  // order of tled::Element

tled::Element element_named(const std::string& name) {
    for (int k = 0; k < 2; ++k)
        if (name == element_names[k]) return static_cast<tled::Element>(k);
    throw InvalidInput("unknown element '" + name + "'; known are T4 and AveragedPressureT4");
}

/// Rows of materials/parameters; what a law does not use is zero.
constexpr int parameter_rows = 8;

/// Version 1 of records knew the two neo-Hookean laws, by the shear modulus and that of the volumetric part.
Eigen::MatrixXd law_parameters_of(const Hdf5Input& file, const std::string& group) {
    if (file.holds(group + "/parameters")) return file.columns<double>(group + "/parameters", parameter_rows);
    const Eigen::VectorXd shear = file.vector<double>(group + "/shear_modulus");
    Eigen::MatrixXd parameters = Eigen::MatrixXd::Zero(parameter_rows, shear.size());
    parameters.row(0) = shear;
    parameters.row(1) = file.vector<double>(group + "/volumetric_modulus", shear.size());
    return parameters;
}

}  // namespace

void write_materials(Hdf5Output& file, const std::string& group, const tled::MaterialTable& materials) {
    const auto count = static_cast<Eigen::Index>(materials.size());
    Eigen::VectorXi label(count);
    Eigen::MatrixXd parameters = Eigen::MatrixXd::Zero(parameter_rows, count);
    std::vector<std::string> law;
    Eigen::Index column = 0;
    for (const auto& [key, material] : materials) {
        const std::vector<double> values = tled::law_parameters(material);
        label[column] = key;
        for (std::size_t k = 0; k < values.size(); ++k) parameters(static_cast<Eigen::Index>(k), column) = values[k];
        law.push_back(tled::law_name(material));
        ++column;
    }
    file.vector<int>(group + "/label", label, "1");
    file.texts(group + "/law", law);
    file.columns<double>(group + "/parameters", parameters, "kPa");
}

tled::MaterialTable read_materials(const Hdf5Input& file, const std::string& group) {
    const Eigen::VectorXi label = file.vector<int>(group + "/label");
    const Eigen::MatrixXd parameters = law_parameters_of(file, group);
    const std::vector<std::string> law = file.texts(group + "/law");
    if (law.size() != static_cast<std::size_t>(label.size()) || parameters.cols() != label.size())
        throw InvalidInput("'" + group + "' names " + std::to_string(law.size()) + " laws and " +
                           std::to_string(parameters.cols()) + " sets of parameters for " +
                           std::to_string(label.size()) + " labels");
    tled::MaterialTable materials;
    for (Eigen::Index row = 0; row < label.size(); ++row) {
        const std::string& name = law[static_cast<std::size_t>(row)];
        const std::size_t count = tled::law_parameters(tled::material_of_law(name)).size();
        const Eigen::VectorXd column = parameters.col(row);
        const tled::Material material =
            tled::material_of_law(name, {column.begin(), column.begin() + static_cast<std::ptrdiff_t>(count)});
        tled::require_valid(material, "label " + std::to_string(label[row]) + " of '" + group + "'");
        if (!materials.emplace(label[row], material).second)
            throw InvalidInput("'" + group + "' holds label " + std::to_string(label[row]) + " twice");
    }
    return materials;
}

void write_mesh(Hdf5Output& file, const std::string& group, const meshing::TetMesh& mesh) {
    file.columns<double>(group + "/nodes", mesh.nodes, "mm");
    file.attribute(group + "/nodes", "frame", "moving image, LPS");
    file.columns<int>(group + "/tetrahedra", mesh.tets, "1");
    file.vector<int>(group + "/labels", mesh.labels, "1");
}

meshing::TetMesh read_mesh(const Hdf5Input& file, const std::string& group) {
    meshing::TetMesh mesh;
    mesh.nodes = file.columns<double>(group + "/nodes", 3);
    mesh.tets = file.columns<int>(group + "/tetrahedra", 4);
    mesh.labels = file.vector<int>(group + "/labels", mesh.tets.cols());
    return mesh;
}

void write_model(Hdf5Output& file, const tled::Model& model) {
    if (!model.viscosity.empty() || model.fibre.size() > 0)
        throw InvalidInput(
            "a record holds elastic materials only: this model has viscosity or fibre directions by element");
    write_mesh(file, "mesh", model.mesh);
    write_materials(file, "materials", model.materials);
    file.texts("element", {element_names[static_cast<int>(model.element)]});
    file.scalar<double>("density", model.density, "kg/mm^3");
}

tled::Model read_model(const Hdf5Input& file) {
    tled::Model model;
    model.mesh = read_mesh(file, "mesh");
    model.materials = read_materials(file, "materials");
    model.element = element_named(file.text("element"));
    model.density = file.scalar<double>("density");
    tled::require_valid(model);
    return model;
}

void write_grid(Hdf5Output& file, const std::string& group, const imaging::Geometry& grid) {
    file.vector<int>(group + "/size", Eigen::Vector3i(grid.size[0], grid.size[1], grid.size[2]), "voxel");
    file.vector<double>(group + "/origin", grid.origin, "mm");
    file.vector<double>(group + "/spacing", grid.spacing, "mm");
    file.columns<double>(group + "/direction", grid.direction.transpose(), "1");
    file.attribute(group + "/direction", "meaning", "columns are the unit axes i, j, k in LPS");
}

imaging::Geometry read_grid(const Hdf5Input& file, const std::string& group) {
    imaging::Geometry grid;
    const Eigen::VectorXi size = file.vector<int>(group + "/size", 3);
    grid.size = {size[0], size[1], size[2]};
    grid.origin = file.vector<double>(group + "/origin", 3);
    grid.spacing = file.vector<double>(group + "/spacing", 3);
    file.array<double>(group + "/direction", grid.direction.data(), {3, 3});
    grid.direction.transposeInPlace();
    imaging::require_valid(grid, group.c_str());
    return grid;
}

std::vector<hsize_t> voxel_shape(const imaging::Geometry& grid) {
    return {static_cast<hsize_t>(grid.size[2]), static_cast<hsize_t>(grid.size[1]), static_cast<hsize_t>(grid.size[0])};
}

void write_label_map(Hdf5Output& file, const std::string& group, const imaging::Volume& labels) {
    const imaging::Volume integers = labels.as(CV_32S);
    write_grid(file, group + "/grid", labels.geometry);
    file.array<int>(group + "/voxels", integers.data<int>(), voxel_shape(labels.geometry), "1");
}

imaging::Volume read_label_map(const Hdf5Input& file, const std::string& group) {
    const imaging::Geometry grid = read_grid(file, group + "/grid");
    file.require_shape(group + "/voxels", voxel_shape(grid));
    imaging::Volume labels(grid, CV_32SC1);
    file.array<int>(group + "/voxels", labels.data<int>(), voxel_shape(grid));
    return labels;
}

void write_stages(Hdf5Output& file, const std::string& group, const std::vector<StageTime>& times) {
    std::vector<std::string> names;
    Eigen::VectorXd seconds(static_cast<Eigen::Index>(times.size()));
    for (const StageTime& time : times) {
        seconds[static_cast<Eigen::Index>(names.size())] = time.seconds;
        names.push_back(time.stage);
    }
    file.texts(group + "/stage", names);
    file.vector<double>(group + "/seconds", seconds, "s");
}

}  // namespace tissuewarp::registration::detail
