#include "registration/prepared/prepared_io.hpp"

#include "registration/io/stored_model.hpp"
#include "registration/loads/coarse_twin.hpp"
#include "registration/matching/image_matching.hpp"
#include "registration/prepared/stored_prepared.hpp"
#include "registration/terms/anchors.hpp"

#include "core/atomic_file.hpp"
#include "core/file_message.hpp"
#include "registration/boundary/surroundings.hpp"

namespace tissuewarp::registration {

namespace {

constexpr const char* moving_labels = "moving_labels";
constexpr const char* coarse_mesh = "coarse_mesh";  // absent without a coarse model; since version 3
constexpr const char* image = "image";              // absent without an image model; since version 4

/// Of a further image; since version 5.
std::string contrast_group(std::size_t number) {
    return "contrasts/" + std::to_string(number);
}

void write_list(Hdf5Output& file, const std::string& name, const std::vector<int>& list) {
    file.vector<int>(name, Eigen::VectorXi::Map(list.data(), static_cast<Eigen::Index>(list.size())), "1");
}

/// Empty where a version had no such list.
std::vector<int> read_list(const Hdf5Input& file, const std::string& name) {
    if (!file.holds(name)) return {};
    const Eigen::VectorXi list = file.vector<int>(name);
    return {list.begin(), list.end()};
}

void write_meshing(Hdf5Output& file, const meshing::MeshingOptions& options) {
    file.scalar<double>("options/meshing/edge_length", options.edge_length, "mm");
    Eigen::VectorXi label(static_cast<Eigen::Index>(options.label_edge_length.size()));
    Eigen::VectorXd length(label.size());
    Eigen::Index row = 0;
    for (const auto& [key, value] : options.label_edge_length) {
        label[row] = key;
        length[row++] = value;
    }
    file.vector<int>("options/meshing/label_edge_length/label", label, "1");
    file.vector<double>("options/meshing/label_edge_length/length", length, "mm");
    file.scalar<double>("options/meshing/facet_distance", options.facet_distance, "mm");
    file.scalar<double>("options/meshing/facet_angle", options.facet_angle, "degree");
    file.scalar<double>("options/meshing/radius_edge_ratio", options.radius_edge_ratio, "1");
    file.scalar<double>("options/meshing/smoothing", options.smoothing, "voxel");
    file.scalar<double>("options/meshing/min_dihedral_deg", options.min_dihedral_deg, "degree");
    file.scalar<double>("options/meshing/perturb_seconds", options.perturb_seconds, "s");
    file.scalar<double>("options/meshing/exude_seconds", options.exude_seconds, "s");
    write_list(file, "options/meshing/labels", options.labels);
}

meshing::MeshingOptions read_meshing(const Hdf5Input& file) {
    meshing::MeshingOptions options;
    options.edge_length = file.scalar<double>("options/meshing/edge_length");
    const Eigen::VectorXi label = file.vector<int>("options/meshing/label_edge_length/label");
    const Eigen::VectorXd length = file.vector<double>("options/meshing/label_edge_length/length", label.size());
    for (Eigen::Index row = 0; row < label.size(); ++row) options.label_edge_length[label[row]] = length[row];
    options.facet_distance = file.scalar<double>("options/meshing/facet_distance");
    options.facet_angle = file.scalar<double>("options/meshing/facet_angle");
    options.radius_edge_ratio = file.scalar<double>("options/meshing/radius_edge_ratio");
    options.smoothing = file.scalar<double>("options/meshing/smoothing");
    options.min_dihedral_deg = file.scalar<double>("options/meshing/min_dihedral_deg");
    options.perturb_seconds = file.scalar<double>("options/meshing/perturb_seconds");
    options.exude_seconds = file.scalar<double>("options/meshing/exude_seconds");
    options.labels = read_list(file, "options/meshing/labels");
    return options;
}

tled::Material only_material(const Hdf5Input& file, const std::string& group) {
    const tled::MaterialTable table = detail::read_materials(file, group);
    if (table.size() != 1)
        throw InvalidInput("'" + group + "' holds " + std::to_string(table.size()) + " materials, not 1");
    return table.begin()->second;
}

void read_coarse_model(const Hdf5Input& file, const std::filesystem::path& path, PreparedModel& prepared,
                       Observer& observer) {
    meshing::TetMesh mesh = detail::read_mesh(file, coarse_mesh);
    const std::string name = path.string() + ": " + coarse_mesh;
    meshing::require_valid(mesh, name.c_str());
    prepared.coarse =
        std::make_unique<PreparedModel>(detail::coarse_model_for_loads(prepared, std::move(mesh), observer));
}

/// The image and what is looked for of it; the template is made of these again, bit by bit the same.
void write_image(Hdf5Output& file, const std::string& group, const ImageModel& model) {
    const imaging::Volume grey = model.image.as(CV_32F);
    const TemplateOptions& options = model.blocks.options();
    detail::write_grid(file, group + "/grid", grey.geometry);
    file.array<float>(group + "/voxels", grey.data<float>(), detail::voxel_shape(grey.geometry), "1");
    file.columns<double>(group + "/points", model.blocks.points(), "mm");
    file.scalar<double>(group + "/template/grid_spacing", options.grid_spacing_mm, "mm");
    file.scalar<int>(group + "/template/levels", options.levels, "1");
    file.scalar<int>(group + "/template/block_radius", options.block_radius, "voxel");
}

ImageModel read_image(const Hdf5Input& file, const std::string& group) {
    const imaging::Geometry grid = detail::read_grid(file, group + "/grid");
    file.require_shape(group + "/voxels", detail::voxel_shape(grid));
    imaging::Volume grey(grid, CV_32FC1);
    file.array<float>(group + "/voxels", grey.data<float>(), detail::voxel_shape(grid));
    const TemplateOptions options{file.scalar<double>(group + "/template/grid_spacing"),
                                  file.scalar<int>(group + "/template/levels"),
                                  file.scalar<int>(group + "/template/block_radius")};
    return {grey, MatchingTemplate(grey, file.columns<double>(group + "/points", 3), options)};
}

}  // namespace

void detail::write_prepared_parts(Hdf5Output& file, const PreparedModel& prepared) {
    detail::write_model(file, prepared.model);
    const imaging::Volume labels = detail::with_neighbours(prepared);
    if (labels.empty() || labels.channels() != 1)
        throw InvalidInput("the prepared model holds no label map of one component");
    detail::write_label_map(file, moving_labels, labels);
    write_meshing(file, prepared.options.meshing);
    detail::write_materials(file, "options/default_material", {{0, prepared.options.default_material}});
    file.scalar<double>("options/data_stiffness", prepared.options.data_stiffness, "kPa/mm");
    file.scalar<double>("options/tangential_ratio", prepared.options.tangential_ratio, "1");
    write_list(file, "options/anchors", prepared.options.anchors);
    write_list(file, "options/rigid_neighbours", prepared.options.rigid_neighbours);
    if (!prepared.resected.empty()) write_list(file, "options/resected", prepared.options.resected);
    std::vector<int> sliding;
    for (const std::array<int, 2>& pair : prepared.options.sliding)
        sliding.insert(sliding.end(), pair.begin(), pair.end());
    if (!sliding.empty()) write_list(file, "options/sliding", sliding);
    if (prepared.coarse) detail::write_mesh(file, coarse_mesh, prepared.coarse->model.mesh);
    if (prepared.image) write_image(file, image, *prepared.image);
    for (std::size_t n = 0; n < prepared.contrasts.size(); ++n)
        write_image(file, contrast_group(n), *prepared.contrasts[n]);
    detail::write_stages(file, "stages/prepare", prepared.times);
}

PreparedModel detail::read_prepared_parts(const Hdf5Input& file, const std::filesystem::path& path,
                                          Observer& observer) {
    tled::Model model = detail::read_model(file);
    PrepareOptions options;
    options.meshing = read_meshing(file);
    options.materials = model.materials;
    options.default_material = only_material(file, "options/default_material");
    options.element = model.element;
    options.data_stiffness = file.scalar<double>("options/data_stiffness");
    options.tangential_ratio = file.scalar<double>("options/tangential_ratio");
    options.anchors = read_list(file, "options/anchors");
    options.rigid_neighbours = read_list(file, "options/rigid_neighbours");
    options.resected = read_list(file, "options/resected");
    const std::vector<int> sliding = read_list(file, "options/sliding");
    if (sliding.size() % 2 != 0) throw InvalidInput("'options/sliding' holds no pairs of labels");
    for (std::size_t n = 0; n < sliding.size(); n += 2) options.sliding.push_back({sliding[n], sliding[n + 1]});
    if (!(options.data_stiffness > 0) || !(options.tangential_ratio > 0))
        throw InvalidInput("'" + path.string() + "': the stiffness of the data must be positive");
    PreparedModel prepared =
        prepare(std::move(model.mesh), detail::read_label_map(file, moving_labels), options, observer);
    if (file.holds(image)) prepared.image = std::make_shared<const ImageModel>(read_image(file, image));
    for (std::size_t n = 0; prepared.image && file.holds(contrast_group(n)); ++n)
        prepared.contrasts.push_back(std::make_shared<const ImageModel>(read_image(file, contrast_group(n))));
    if (file.holds(coarse_mesh)) read_coarse_model(file, path, prepared, observer);
    return prepared;
}

void write_prepared(const PreparedModel& prepared, const std::filesystem::path& path) {
    AtomicFile target(path);
    Hdf5Output file(target.path(), detail::prepared_format, detail::version_of(prepared));
    detail::write_prepared_parts(file, prepared);
    file.close();
    target.commit();
}

PreparedModel read_prepared(const std::filesystem::path& path, Observer& observer) {
    return naming(path, [&] {
        try {
            const Hdf5Input file(path, detail::prepared_format, detail::prepared_version,
                                 detail::oldest_prepared_version);
            return detail::read_prepared_parts(file, path, observer);
        } catch (const SolverFailure& failure) {  // sizes or materials whose stiffness is no number
            throw InvalidInput(std::string("its tissue cannot be computed with: ") + failure.what());
        }
    });
}

}  // namespace tissuewarp::registration
