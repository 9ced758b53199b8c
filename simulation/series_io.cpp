#include "simulation/series_io.hpp"

#include "core/atomic_file.hpp"
#include "core/detail/hdf5.hpp"
#include "core/errors.hpp"
#include "meshing/mesh_io.hpp"
#include "simulation/xdmf.hpp"
#include "tled/model/internal_force.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <string>

namespace tissuewarp::simulation {

using Eigen::Matrix3Xd;

namespace {

/// Shortest form that reads back, "nan" for what is gone.
std::string number(double value) {
    if (!std::isfinite(value)) return "nan";
    std::array<char, 32> buffer;
    return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}

std::string vtu_name(int frame) {
    const std::string digits = std::to_string(frame);
    return "frame_" + std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0') + digits + ".vtu";
}

/// A name as a CSV field.
std::string quoted(const std::string& name) {
    std::string text = "\"";
    for (const char c : name) text += c == '"' ? "\"\"" : std::string(1, c);
    return text + "\"";
}

}  // namespace

struct SeriesWriter::Impl {
    const BuiltScene& built;
    std::filesystem::path folder;
    Hdf5Output record;
    std::ofstream probes;
    std::string collection;
    XdmfSeries frames;

    Impl(const BuiltScene& scene, const std::filesystem::path& where)
        : built(scene),
          folder(where),
          record(folder / "displacement.h5", series_format, series_version),
          probes(folder / "probes.csv", std::ios::binary) {
        record.columns<double>("mesh/nodes", built.mesh.nodes, "mm, LPS");
        record.columns<int>("mesh/tetrahedra", built.mesh.tets, "");
        record.vector<int>("mesh/labels", built.mesh.labels, "");
        frames.record = "displacement.h5";
        frames.nodes = built.mesh.node_count();
        probes << "time_s,probe,x_mm,y_mm,z_mm,dx_mm,dy_mm,dz_mm\n";
        require_written();
    }

    void require_written() const {
        if (!probes)
            throw IoError("cannot write '" + (folder / "probes.csv").string() +
                          "'; check that the folder exists and the disk has room");
    }

    void add_vtu(const Frame& frame) {
        const Stage& stage = built.stages[static_cast<std::size_t>(frame.stage)];
        const std::string name = vtu_name(frame.index);
        Eigen::VectorXd in_mesh = tled::jacobians(stage.rest, frame.displacement);
        meshing::write_vtu(stage.model.mesh, folder / name, {{"displacement", frame.displacement}},
                           {{"J", in_mesh.transpose()}});
        collection += "    <DataSet timestep=\"" + number(frame.time) + "\" part=\"0\" file=\"" + name + "\"/>\n";
    }

    void add_times() {
        const auto count = static_cast<Eigen::Index>(frames.frames.size());
        Eigen::VectorXd time(count);
        Eigen::VectorXi stage(count);
        for (Eigen::Index f = 0; f < count; ++f) {
            const XdmfFrame& frame = frames.frames[static_cast<std::size_t>(f)];
            time[f] = frame.time;
            stage[f] = static_cast<int>(frame.stage);
        }
        record.vector<double>("time", time, "s");
        record.vector<int>("stage", stage, "");
    }

    /// What of the mesh is left, where that is not all of it.
    void add_stages() {
        for (std::size_t s = 0; s < built.stages.size(); ++s) {
            if (s == 0) {
                frames.stages.push_back({"mesh/tetrahedra", "mesh/labels", built.mesh.tet_count()});
                continue;
            }
            const std::vector<int>& tets = built.stages[s].tet;
            const Eigen::Map<const Eigen::VectorXi> left(tets.data(), static_cast<Eigen::Index>(tets.size()));
            const std::string name = "remaining/" + std::to_string(s), mesh = "remaining_mesh/" + std::to_string(s);
            record.vector<int>(name, left, "");
            record.columns<int>(mesh + "/tetrahedra", built.mesh.tets(Eigen::all, left), "");
            record.vector<int>(mesh + "/labels", built.mesh.labels(left), "");
            frames.stages.push_back({mesh + "/tetrahedra", mesh + "/labels", static_cast<int>(tets.size())});
        }
    }

    void add_probes(const Frame& frame) {
        const Matrix3Xd displacement = probe_displacements(built, frame);
        for (std::size_t p = 0; p < built.probes.size(); ++p) {
            probes << number(frame.time) << ',' << quoted(built.scene.probes[p].name);
            for (const double x : built.scene.probes[p].at) probes << ',' << number(x);
            for (const double d : displacement.col(static_cast<Eigen::Index>(p))) probes << ',' << number(d);
            probes << '\n';
        }
        require_written();
    }
};

SeriesWriter::SeriesWriter(const BuiltScene& built, const std::filesystem::path& folder)
    : impl_(std::make_unique<Impl>(built, folder)) {}

SeriesWriter::~SeriesWriter() = default;

void SeriesWriter::add(const Frame& frame) {
    impl_->add_vtu(frame);
    impl_->add_probes(frame);
    const Matrix3Xd all = on_scene_mesh(impl_->built, frame);
    impl_->record.append("displacement", all.data(), {static_cast<hsize_t>(all.cols()), 3}, "mm");
    impl_->frames.frames.push_back({frame.time, static_cast<std::size_t>(frame.stage)});
}

void SeriesWriter::finish() {
    Impl& series = *impl_;
    series.add_times();
    series.add_stages();
    series.record.close();
    series.probes.close();
    series.require_written();
    write_file(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\" byte_order=\"LittleEndian\">\n"
        "  <Collection>\n" +
            series.collection + "  </Collection>\n</VTKFile>\n",
        series.folder / "frames.pvd");
    write_xdmf(series.frames, series.folder / "frames.xdmf");
}

}  // namespace tissuewarp::simulation
