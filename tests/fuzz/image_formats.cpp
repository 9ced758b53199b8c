// NIfTI, NRRD and MetaImage, each as its writers vary it.

#include "core/errors.hpp"
#include "imaging/image_io.hpp"
#include "imaging/sweep.hpp"
#include "tests/fuzz/format.hpp"
#include "tests/fuzz/image_reading.hpp"

#include <cstring>
#include <numeric>

namespace tissuewarp::fuzz {

namespace {

constexpr std::array<int, 3> size{6, 5, 4};
constexpr std::size_t voxels = 120;

std::string raw_labels() {
    std::string bytes;
    for (std::size_t i = 0; i < voxels; ++i) bytes += static_cast<char>(i % 6 < 3 ? 1 : (i / 6) % 3);
    return bytes;
}

std::string raw_shorts() {
    std::string bytes;
    for (std::size_t i = 0; i < voxels; ++i) {
        const auto value = static_cast<std::int16_t>(37 * static_cast<int>(i) - 1000);
        bytes.append(reinterpret_cast<const char*>(&value), 2);
    }
    return bytes;
}

std::string raw_vectors() {
    std::string bytes;
    for (std::size_t i = 0; i < 3 * voxels; ++i) {
        const float value = 0.01F * static_cast<float>(i);
        bytes.append(reinterpret_cast<const char*>(&value), 4);
    }
    return bytes;
}

template <class T>
void put(std::string& header, std::size_t at, T value) {
    std::memcpy(header.data() + at, &value, sizeof value);
}

/// A header of NIfTI-1 with its four bytes of extension.
std::string nifti_header(int type, int bits, int components, bool pair) {
    std::string header(352, '\0');
    put(header, 0, 348);
    const std::array<std::int16_t, 8> dim{
        static_cast<std::int16_t>(components > 1 ? 5 : 3), 6, 5, 4, 1, static_cast<std::int16_t>(components), 1, 1};
    std::memcpy(header.data() + 40, dim.data(), sizeof dim);
    put(header, 68, static_cast<std::int16_t>(components > 1 ? 1007 : 0));
    put(header, 70, static_cast<std::int16_t>(type));
    put(header, 72, static_cast<std::int16_t>(bits));
    const std::array<float, 8> spacing{1, 2, 2, 2.5F, 1, 1, 1, 1};
    std::memcpy(header.data() + 76, spacing.data(), sizeof spacing);
    put(header, 108, pair ? 0.0F : 352.0F);
    put(header, 112, 1.0F);
    put(header, 123, std::int8_t{2});
    put(header, 252, std::int16_t{1});
    put(header, 254, std::int16_t{1});
    const std::array<float, 12> rows{2, 0, 0, -10, 0, 2, 0, 5, 0, 0, 2.5F, 7};
    std::memcpy(header.data() + 280, rows.data(), sizeof rows);
    put(header, 268, -10.0F), put(header, 272, 5.0F), put(header, 276, 7.0F);
    std::memcpy(header.data() + 344, pair ? "ni1" : "n+1", 4);
    return header;
}

std::vector<Field> nifti_fields(const std::string&) {
    std::vector<Field> fields{{0, 4, false},   {68, 2, false},  {70, 2, false},  {72, 2, false},
                              {108, 4, true},  {112, 4, true},  {116, 4, true},  {123, 1, false},
                              {252, 2, false}, {254, 2, false}, {344, 4, false}, {348, 4, false}};
    for (std::size_t n = 0; n < 8; ++n) {
        fields.push_back({40 + 2 * n, 2, false});
        fields.push_back({76 + 4 * n, 4, true});
    }
    for (std::size_t at = 256; at < 328; at += 4) fields.push_back({at, 4, true});
    return fields;
}

Seed nifti_seed(const std::string& name, int type, int bits, int components, const std::string& data, Packing packing) {
    const std::string header = nifti_header(type, bits, components, false);
    if (packing == Packing::None) return single(name, header + data);
    return {{{name, {"", header + data, packing}}}, name};
}

/// As write_volume() makes them; they are small.
Seed written(const std::string& name, const std::filesystem::path& folder) {
    imaging::Geometry grid;
    grid.size = size;
    imaging::Volume volume(grid, CV_16S);
    const std::string data = raw_shorts();
    std::memcpy(volume.voxels.data, data.data(), data.size());
    imaging::write_volume(volume, folder / name);
    return single(name, bytes_at(folder / name));
}

std::vector<Seed> nifti_seeds(const std::filesystem::path& folder) {
    std::vector<Seed> seeds{nifti_seed("a.nii", 4, 16, 1, raw_shorts(), Packing::None),
                            nifti_seed("a.nii.gz", 2, 8, 1, raw_labels(), Packing::Gzip),
                            nifti_seed("v.nii.gz", 16, 32, 3, raw_vectors(), Packing::Gzip),
                            nifti_seed("v.nii", 16, 32, 3, raw_vectors(), Packing::None),
                            written("w.nii", folder),
                            written("w.nii.gz", folder)};
    const std::string pair = nifti_header(4, 16, 1, true);
    seeds.push_back({{{"p.hdr", {pair, "", Packing::None}}, {"p.img", {raw_shorts(), "", Packing::None}}}, "p.hdr"});
    seeds.push_back(
        {{{"q.hdr.gz", {"", pair, Packing::Gzip}}, {"q.img.gz", {"", raw_shorts(), Packing::Gzip}}}, "q.img.gz"});
    return seeds;
}

std::string nrrd_header(const std::string& type, const std::string& encoding, const std::string& more = "") {
    return "NRRD0005\n# a remark\ntype: " + type + "\ndimension: 3\nspace: left-posterior-superior\nsizes: 6 5 4\n" +
           "space directions: (2,0,0) (0,2,0) (0,0,2.5)\nkinds: domain domain domain\nendian: little\nencoding: " +
           encoding + "\nspace origin: (-10,5,7)\nspace units: \"mm\" \"mm\" \"mm\"\n" + more;
}

std::string as_text(const std::string& bytes) {
    std::string text;
    for (const char c : bytes) text += std::to_string(static_cast<int>(c)) + ' ';
    return text;
}

std::string as_hexadecimal(const std::string& bytes) {
    std::string text;
    for (const char c : bytes) {
        text += "0123456789abcdef"[static_cast<unsigned char>(c) / 16];
        text += "0123456789abcdef"[static_cast<unsigned char>(c) % 16];
    }
    return text;
}

Seed segmentation() {
    const std::string header =
        "NRRD0004\ntype: unsigned char\ndimension: 4\nspace: right-anterior-superior\nsizes: 2 6 5 4\n"
        "space directions: none (2,0,0) (0,2,0) (0,0,2)\nkinds: list domain domain domain\nencoding: gzip\n"
        "space origin: (0,0,0)\nSegment0_ID:=Segment_1\nSegment0_Name:=liver\nSegment0_LabelValue:=1\n"
        "Segment0_Layer:=0\nSegment1_ID:=Segment_2\nSegment1_Name:=tumour\nSegment1_LabelValue:=1\n"
        "Segment1_Layer:=1\n\n";
    std::string layers;
    for (const char c : raw_labels()) layers += std::string{c == 1 ? '\1' : '\0', c == 2 ? '\1' : '\0'};
    return {{{"s.seg.nrrd", {header, layers, Packing::Gzip}}}, "s.seg.nrrd"};
}

std::vector<Seed> nrrd_seeds(const std::filesystem::path& folder) {
    const std::string vectors =
        "NRRD0004\ntype: float\ndimension: 4\nspace: RAS\nsizes: 3 6 5 4\nspace directions: none (2,0,0) (0,2,0) "
        "(0,0,2)\nkinds: vector domain domain domain\nendian: little\nencoding: gzip\nspace origin: (0,0,0)\n\n";
    std::vector<Seed> seeds{
        single("a.nrrd", nrrd_header("short", "raw", "\n") + raw_shorts()),
        single("t.nrrd", nrrd_header("uchar", "ascii", "\n") + as_text(raw_labels())),
        single("h.nrrd", nrrd_header("uchar", "hex", "\n") + as_hexadecimal(raw_labels())),
        single("o.nrrd",
               "NRRD0001\ntype: uchar\ndimension: 3\nsizes: 6 5 4\nspacings: 2 2 2.5\naxis mins: 0 1 2\n"
               "units: \"mm\" \"mm\" \"cm\"\nencoding: raw\n\n" +
                   raw_labels()),
        {{{"g.nrrd", {nrrd_header("uchar", "gzip", "\n"), raw_labels(), Packing::Gzip}}}, "g.nrrd"},
        {{{"v.nrrd", {vectors, raw_vectors(), Packing::Gzip}}}, "v.nrrd"},
        segmentation(),
        written("w.nrrd", folder)};
    seeds.push_back({{{"d.nhdr", {nrrd_header("short", "raw", "line skip: 1\nbyte skip: 2\ndata file: d.raw\n"), ""}},
                      {"d.raw", {"one line\n12" + raw_shorts(), ""}}},
                     "d.nhdr"});
    Seed slices{{{"s.nhdr", {nrrd_header("uchar", "raw", "data file: s%d.raw 1 4 1\n"), ""}}}, "s.nhdr"};
    Seed list{{{"l.nhdr", {nrrd_header("uchar", "raw", "data file: LIST\nl0.raw\nl1.raw\nl2.raw\nl3.raw\n"), ""}}},
              "l.nhdr"};
    for (std::size_t k = 0; k < 4; ++k) {
        slices.files["s" + std::to_string(k + 1) + ".raw"] = {raw_labels().substr(30 * k, 30), ""};
        list.files["l" + std::to_string(k) + ".raw"] = {raw_labels().substr(30 * k, 30), ""};
    }
    seeds.push_back(slices);
    seeds.push_back(list);
    return seeds;
}

std::string meta_header(const std::string& type, const std::string& more, const std::string& data) {
    return "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\n" + more +
           "TransformMatrix = 1 0 0 0 1 0 0 0 1\nOffset = -10 5 7\nCenterOfRotation = 0 0 0\nElementSpacing = 2 2 2.5\n"
           "DimSize = 6 5 4\nAnatomicalOrientation = RAI\nElementType = " +
           type + "\nElementDataFile = " + data + "\n";
}

std::vector<Seed> meta_seeds(const std::filesystem::path& folder) {
    std::vector<Seed> seeds{
        single("a.mha", meta_header("MET_SHORT", "", "LOCAL") + raw_shorts()),
        {{{"c.mha", {meta_header("MET_UCHAR", "CompressedData = True\n", "LOCAL"), raw_labels(), Packing::Zlib}}},
         "c.mha"},
        single("v.mha", meta_header("MET_FLOAT", "ElementNumberOfChannels = 3\n", "LOCAL") + raw_vectors()),
        {{{"d.mhd", {meta_header("MET_SHORT", "HeaderSize = -1\n", "d.raw"), ""}},
          {"d.raw", {"some header" + raw_shorts(), ""}}},
         "d.mhd"},
        {{{"z.mhd", {meta_header("MET_SHORT", "CompressedData = True\n", "z.zraw"), ""}},
          {"z.zraw", {"", raw_shorts(), Packing::Zlib}}},
         "z.mhd"},
        single("t.mha",
               "ObjectType = Image\nNDims = 3\nBinaryData = False\nDimSize = 6 5 4\nElementSize = 1 1 1\n"
               "DistanceUnits = cm\nElementType = MET_UCHAR\nElementDataFile = LOCAL\n" +
                   as_text(raw_labels())),
        written("w.mha", folder)};
    Seed slices{{{"s.mhd", {meta_header("MET_UCHAR", "", "s%02d.raw 1 4 1"), ""}}}, "s.mhd"};
    Seed list{{{"l.mhd", {meta_header("MET_UCHAR", "", "LIST") + "l0.raw\nl1.raw\nl2.raw\nl3.raw\n", ""}}}, "l.mhd"};
    for (std::size_t k = 0; k < 4; ++k) {
        slices.files["s0" + std::to_string(k + 1) + ".raw"] = {raw_labels().substr(30 * k, 30), ""};
        list.files["l" + std::to_string(k) + ".raw"] = {raw_labels().substr(30 * k, 30), ""};
    }
    seeds.push_back(slices);
    seeds.push_back(list);
    return seeds;
}

/// Three frames of a tracked probe, by two ways.
std::vector<Seed> sweep_seeds(const std::filesystem::path&) {
    const std::string head =
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nDimSize = 6 5 4\n"
        "ElementSpacing = 1 1 1\nElementType = MET_UCHAR\nUltrasoundImageOrientation = UN\n"
        "UltrasoundImageType = BRIGHTNESS\n";
    std::string direct = head, chained = head;
    for (int n = 0; n < 4; ++n) {
        const std::string frame = "Seq_Frame000" + std::to_string(n) + "_", way = " 0 0.5 0 -7.5 0 0 1 ";
        direct += frame + "ImageToReferenceTransform = 0.5 0 0 12" + way + std::to_string(n) + " 0 0 0 1\n" + frame +
                  "ImageToReferenceTransformStatus = " + (n == 1 ? "INVALID\n" : "OK\n");
        chained += frame + "ImageToProbeTransform = 0.1 0 0 0 0 0.1 0 0 0 0 0.1 0 0 0 0 1\n" + frame +
                   "ProbeToTrackerTransform = 1 0 0 3 0 1 0 4 0 0 1 " + std::to_string(n) + " 0 0 0 1\n" + frame +
                   "ReferenceToTrackerTransform = 0 1 0 3 -1 0 0 4 0 0 1 2 0 0 0 1\n" + frame + "ImageStatus = OK\n";
    }
    const std::string end = "ElementDataFile = LOCAL\n";
    return {
        single("direct.mha", direct + end + raw_labels()),
        {{{"chained.mha", {chained + "CompressedData = True\n" + end, raw_labels(), Packing::Zlib}}}, "chained.mha"}};
}

void read_frames(const std::filesystem::path& path, Digest& digest) {
    const imaging::Sweep sweep = imaging::read_sweep(path);
    digest.voxels(sweep.pixels);
    for (const imaging::SweepFrame& frame : sweep.frames) digest.matrix(frame.to_patient.matrix());
}

}  // namespace

void read_image(const std::filesystem::path& path, Digest& digest) {
    const imaging::ReadResult read = imaging::read_volume_with_notes(path);
    digest.voxels(read.volume.voxels);
    digest.matrix(read.volume.geometry.origin);
    digest.matrix(read.volume.geometry.spacing);
    digest.matrix(read.volume.geometry.direction);
    for (const auto& [label, name] : read.label_names) digest.text(std::to_string(label) + name);
    try {
        digest.voxels(imaging::as_labels(read, path).volume.voxels);
    } catch (const InvalidInput&) {  // a grey image, vectors, …
    }
}

std::vector<Format> image_formats() {
    return {{"nifti", nifti_seeds, read_image, nifti_fields},
            {"nrrd", nrrd_seeds, read_image},
            {"meta-image", meta_seeds, read_image},
            {"sweep", sweep_seeds, read_frames}};
}

}  // namespace tissuewarp::fuzz
