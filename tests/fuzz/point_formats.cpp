// Points, pairs of them and curves: tables, markups of 3D Slicer, points of elastix; measured fronts, which are JSON
// too.

#include "core/errors.hpp"
#include "imaging/label_names.hpp"
#include "meshing/point_table.hpp"
#include "registration/dial/fronts_io.hpp"
#include "registration/evaluation.hpp"
#include "registration/io/curves.hpp"
#include "registration/io/surface_points.hpp"
#include "tests/fuzz/format.hpp"

namespace tissuewarp::fuzz {

namespace {

using meshing::Polylines;

void add(Digest& digest, const Polylines& read) {
    digest.matrix(read.nodes);
    for (const std::vector<int>& line : read.lines)
        digest.matrix(Eigen::VectorXi::Map(line.data(), static_cast<Eigen::Index>(line.size())));
}

/// As points, then as curves and as a pair with itself, which may be refused.
void read_points(const std::filesystem::path& path, Digest& digest) {
    digest.matrix(registration::read_points(path));
    try {
        digest.matrix(registration::read_landmarks(path, path).fixed);
    } catch (const InvalidInput&) {  // names that repeat, …
    }
    try {
        add(digest, registration::read_curve_file(path));
        const registration::Curves curves = registration::read_curves(path, path);
        digest.matrix(curves.fixed);
        digest.matrix(curves.tangents);
    } catch (const InvalidInput&) {  // no lines, …
    }
}

void read_table(const std::filesystem::path& path, Digest& digest) {
    const meshing::PointTable table = meshing::read_point_table(path);
    digest.matrix(table.normals);
    for (const std::string& name : table.names) digest.text(name);
    for (const std::string& name : table.groups) digest.text(name);
    read_points(path, digest);
    try {
        digest.matrix(registration::read_surface_points(path).points);
    } catch (const InvalidInput&) {  // too few, …
    }
}

void read_pairs(const std::filesystem::path& path, Digest& digest) {
    const registration::Landmarks pairs = registration::read_landmarks(path);
    digest.matrix(pairs.moving);
    digest.matrix(pairs.fixed);
    digest.number(registration::is_table_of_pairs(path));
}

void read_fronts(const std::filesystem::path& path, Digest& digest) {
    digest.text(registration::to_json_text(registration::fronts_from_json(bytes_at(path), path.string())));
}

void read_names(const std::filesystem::path& path, Digest& digest) {
    for (const auto& [label, name] : imaging::read_label_names(path)) digest.text(std::to_string(label) + name);
}

std::vector<Seed> name_seeds(const std::filesystem::path&) {
    return {single("a.ctbl", "# Color table file\n0 Background 0 0 0 0\n1 left_lung 128 174 128 255\n2 b 1 2 3 255\n"),
            single("b.csv",
                   "LabelValue,Name,Color_R,Color_G,Color_B,Type_CodeMeaning\n1,\"a, b\",1,2,3,Lung\n2,,1,2,3,Heart\n"),
            single("c.txt", "# IDX\n 0 0 0 0 0 0 0 \"Clear\"\n 1 255 0 0 0.5 1 1 \"left lung\"\n")};
}

std::vector<Seed> table_seeds(const std::filesystem::path&) {
    std::string cloud = "x,y,z,nx,ny,nz\n";
    for (int n = 0; n < 12; ++n) cloud += std::to_string(n) + ".5," + std::to_string(n * n) + ",-3e0," + "0,0,1\n";
    return {single("a.csv", cloud),
            single("b.csv", "x;y;z\n1,5;2,25;-3,0\n10,5;20;30\n\n"),
            single("c.csv",
                   "\xEF\xBB\xBFname\tr\ta\ts\tline\r\n\"P 1\"\t1\t2\t3\tA\r\nP2\t10\t20\t30\tA\r\n"
                   "P3\t11\t21\t31\t\r\n"),
            single("d.csv", "sep=;\nlabel;x (mm);y (mm);z (mm);defined\nF-1;1.5;2;3;1\nF-2;4;5;6;0\n"),
            single("e.xyz", "# RAS\n1 2 3\n4 5 6\n7 8 9\n"),
            single("f.csv", "// x y z line\n1 2 3 a\n4 5 6 a\n")};
}

std::vector<Seed> pair_seeds(const std::filesystem::path&) {
    return {single("a.csv", "name,pre_x,pre_y,pre_z,intra_x,intra_y,intra_z\nA,1,2,3,4,5,6\nB,7,8,9,1e1,11,12\n"),
            single("b.csv", "pre_r;pre_a;pre_s;intra_l;intra_p;intra_s\n1,5;2;3;4;5;6,25\n")};
}

std::vector<Seed> elastix_seeds(const std::filesystem::path&) {
    return {single("a.txt", "point\n3\n1 2 3\n4.5 5 6\n7 8 9e0\n"), single("b.pts", "point\r\n1\r\n1 2 3\r\n")};
}

std::vector<Seed> markup_seeds(const std::filesystem::path&) {
    const auto list = [](const std::string& type, const std::string& system, const std::string& points) {
        return "{\"@schema\": \"https://raw.githubusercontent.com/slicer/slicer/master/Modules/Loadable/Markups/"
               "Resources/Schema/markups-schema-v1.0.3.json#\", \"markups\": [{\"type\": \"" +
               type + "\", \"coordinateSystem\": " + system + ", \"coordinateUnits\": \"mm\", \"controlPoints\": [" +
               points + "]}]}";
    };
    const auto point = [](const std::string& name, const std::string& position, const std::string& status) {
        return "{\"id\": \"" + name + "\", \"label\": \"F-" + name + "\", \"position\": " + position +
               ", \"orientation\": [1, 0, 0, 0, 1, 0, 0, 0, 1], \"selected\": true, \"visibility\": true, "
               "\"positionStatus\": \"" +
               status + "\"}";
    };
    const std::string points = point("1", "[1.5, 2, 3]", "defined") + ",\n" + point("2", "[4, 5e0, 16]", "defined") +
                               ",\n" + point("3", "[0, 0, 0]", "undefined") + ",\n" +
                               point("4", "[-7, 8, 9]", "defined");
    return {single("a.mrk.json", list("Fiducial", "\"LPS\"", points)),
            single("b.mrk.json", list("Curve", "\"RAS\"", points)), single("c.json", list("ClosedCurve", "0", points))};
}

std::vector<Seed> fcsv_seeds(const std::filesystem::path&) {
    return {single("a.fcsv",
                   "# Markups fiducial file version = 4.11\n# CoordinateSystem = LPS\n"
                   "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
                   "1,10.5,20,30,0,0,0,1,1,1,0,F-1,,\n2,11,21,31e0,0,0,0,1,1,1,0,F-2,,\n"),
            single("b.fcsv",
                   "# Markups fiducial file version = 5.4\n# CoordinateSystem = RAS,,\n"
                   "# columns = id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID\n"
                   "1,10.5,20,30,0,0,0,1,1,1,0,F-1,,,2,0\n2,0,0,0,0,0,0,1,1,1,0,F-2,,,0,0\n")};
}

std::vector<Seed> front_seeds(const std::filesystem::path&) {
    return {single("fronts.json", registration::to_json_text(registration::shipped_fronts()))};
}

}  // namespace

std::vector<Format> point_formats() {
    return {{"table", table_seeds, read_table},     {"label-names", name_seeds, read_names},
            {"pairs", pair_seeds, read_pairs},      {"elastix-points", elastix_seeds, read_points},
            {"markups", markup_seeds, read_points}, {"fcsv", fcsv_seeds, read_points},
            {"fronts", front_seeds, read_fronts}};
}

}  // namespace tissuewarp::fuzz
