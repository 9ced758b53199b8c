#include "simulation/xdmf.hpp"

#include "core/atomic_file.hpp"

#include <array>
#include <charconv>

namespace tissuewarp::simulation {
namespace {

const std::string real_number = R"(NumberType="Float" Precision="8")";
const std::string whole_number = R"(NumberType="Int" Precision="4")";

/// Shortest form that reads back.
std::string text(double value) {
    std::array<char, 32> buffer;
    return {buffer.data(), std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr};
}
std::string text(std::size_t value) {
    return std::to_string(value);
}
std::string text(int value) {
    return std::to_string(value);
}

std::string dataset(const XdmfSeries& series, const std::string& name, const std::string& shape,
                    const std::string& number) {
    return "<DataItem Dimensions=\"" + shape + "\" " + number + " Format=\"HDF\">" + series.record + ":/" + name +
           "</DataItem>\n";
}

/// Displacements of all frames are one dataset; a frame is a slab of it: where it begins, its strides, its shape.
std::string slab(const XdmfSeries& series, std::size_t frame) {
    const std::string nodes = text(series.nodes);
    return "<DataItem ItemType=\"HyperSlab\" Dimensions=\"" + nodes + " 3\" " + real_number +
           ">\n"
           "            <DataItem Dimensions=\"3 3\" Format=\"XML\">" +
           text(frame) + " 0 0 1 1 1 1 " + nodes + " 3</DataItem>\n            " +
           dataset(series, "displacement", text(series.frames.size()) + " " + nodes + " 3", real_number) +
           "          </DataItem>\n";
}

std::string grid(const XdmfSeries& series, std::size_t frame) {
    const XdmfStage& stage = series.stages[series.frames[frame].stage];
    const std::string cells = text(stage.count);
    return "      <Grid Name=\"frame " + text(frame) +
           "\" GridType=\"Uniform\">\n"
           "        <Time Value=\"" +
           text(series.frames[frame].time) +
           "\"/>\n"
           "        <Topology TopologyType=\"Tetrahedron\" NumberOfElements=\"" +
           cells + "\">\n          " + dataset(series, stage.tetrahedra, cells + " 4", whole_number) +
           "        </Topology>\n"
           "        <Geometry GeometryType=\"XYZ\">\n          " +
           dataset(series, "mesh/nodes", text(series.nodes) + " 3", real_number) +
           "        </Geometry>\n"
           "        <Attribute Name=\"label\" AttributeType=\"Scalar\" Center=\"Cell\">\n          " +
           dataset(series, stage.labels, cells, whole_number) +
           "        </Attribute>\n"
           "        <Attribute Name=\"displacement\" AttributeType=\"Vector\" Center=\"Node\">\n          " +
           slab(series, frame) + "        </Attribute>\n      </Grid>\n";
}

}  // namespace

void write_xdmf(const XdmfSeries& series, const std::filesystem::path& path) {
    std::string xml =
        "<?xml version=\"1.0\"?>\n<Xdmf Version=\"2.0\">\n  <Domain>\n"
        "    <Grid Name=\"tissue\" GridType=\"Collection\" CollectionType=\"Temporal\">\n";
    for (std::size_t frame = 0; frame < series.frames.size(); ++frame) xml += grid(series, frame);
    write_file(xml + "    </Grid>\n  </Domain>\n</Xdmf>\n", path);
}

}  // namespace tissuewarp::simulation
