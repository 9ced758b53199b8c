// DICOM: series of single slices, files of many frames, segmentations; plain, deflated and in run lengths.

#include "tests/fuzz/format.hpp"
#include "tests/fuzz/image_reading.hpp"
#include "tests/imaging/dicom_contours.hpp"

#include <gdcmImage.h>
#include <gdcmImageChangeTransferSyntax.h>
#include <gdcmSequenceOfFragments.h>
#include <gdcmTrace.h>
#include <Eigen/Core>

#include <stdexcept>

namespace tissuewarp::fuzz {

namespace {

using imaging::test::decimals;
using imaging::test::Elements;

constexpr int columns = 32, rows = 32, slices = 4;  // JPEG 2000 takes no less

std::string one(double value) {
    return decimals(Eigen::VectorXd::Constant(1, value));
}

std::vector<std::int16_t> pixels(int frames) {
    std::vector<std::int16_t> values;
    for (int i = 0; i < columns * rows * frames; ++i) values.push_back(static_cast<std::int16_t>(37 * i - 1000));
    return values;
}

void describe(Elements& data, int bits, int frames) {
    data.short_value(0x28, 2, 1);
    data.text(0x28, 4, "CS", "MONOCHROME2");
    if (frames > 0) data.text(0x28, 8, "IS", std::to_string(frames));
    data.short_value(0x28, 0x10, rows);
    data.short_value(0x28, 0x11, columns);
    if (frames == 0) data.text(0x28, 0x30, "DS", "2\\2");
    data.short_value(0x28, 0x100, bits);
    data.short_value(0x28, 0x101, bits);
    data.short_value(0x28, 0x102, bits - 1);
    data.short_value(0x28, 0x103, bits == 16 ? 1 : 0);
}

/// Behind the preamble, the file's own header; data as `packing` has them.
SeedFile dicom_file(const std::string& image_class, const Elements& data, const char* syntax) {
    Elements meta, length;
    meta.text(2, 2, "UI", image_class);
    meta.text(2, 3, "UI", "1.2.3.9");
    meta.text(2, 0x10, "UI", syntax);
    length.long_value(2, 0, static_cast<std::uint32_t>(meta.bytes().size()));
    const std::string head = std::string(128, '\0') + "DICM" + length.bytes() + meta.bytes();
    if (syntax == imaging::test::deflated) return {head, data.bytes(), Packing::Deflate};
    return {head + data.bytes(), "", Packing::None};
}

SeedFile slice(int k) {
    const std::string ct = "1.2.840.10008.5.1.4.1.1.2";
    Elements data;
    data.text(8, 8, "CS", "ORIGINAL\\PRIMARY");
    data.text(8, 0x16, "UI", ct);
    data.text(8, 0x18, "UI", "1.2.3.9." + std::to_string(k + 1));
    data.text(8, 0x60, "CS", "CT");
    data.text(0x18, 0x50, "DS", "2.5");
    data.text(0x20, 0xd, "UI", "1.2.3");
    data.text(0x20, 0xe, "UI", "1.2.3.4");
    data.text(0x20, 0x13, "IS", std::to_string(k + 1));
    data.text(0x20, 0x32, "DS", decimals(Eigen::Vector3d(-10, 5, 2.5 * k)));
    data.text(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0");
    describe(data, 16, 0);
    data.text(0x28, 0x1052, "DS", "-1024");
    data.text(0x28, 0x1053, "DS", "1");
    data.words(0x7fe0, 0x10, pixels(1));
    return dicom_file(ct, data, imaging::test::explicit_little_endian);
}

/// Attributes of a file of many frames up to its pixels, one frame a slice and segment.
Elements many_frames(const std::string& image_class, const std::string& modality, int bits, int segments) {
    const int frames = slices * std::max(segments, 1);
    Elements data, orientation, measures, shared;
    data.text(8, 0x16, "UI", image_class);
    data.text(8, 0x60, "CS", modality);
    data.text(0x20, 0xe, "UI", "1.2.3.4");
    describe(data, bits, frames);
    std::vector<Elements> names;
    for (int s = 1; s <= segments; ++s) {
        Elements name;
        name.short_value(0x62, 4, s);
        name.text(0x62, 5, "LO", s == 1 ? "liver" : "tumour");
        names.push_back(name);
    }
    if (segments > 0) data.text(0x62, 1, "CS", "BINARY");
    if (segments > 0) data.sequence(0x62, 2, names);
    orientation.text(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0");
    measures.text(0x18, 0x50, "DS", "2.5");
    measures.text(0x28, 0x30, "DS", "2\\2");
    shared.sequence(0x20, 0x9116, {orientation});
    shared.sequence(0x28, 0x9110, {measures});
    data.sequence(0x5200, 0x9229, {shared});
    std::vector<Elements> own;
    for (int frame = 0; frame < frames; ++frame) {
        Elements position, transformation, segment, groups;
        position.text(0x20, 0x32, "DS", decimals(Eigen::Vector3d(-10, 5, 2.5 * (frame % slices))));
        groups.sequence(0x20, 0x9113, {position});
        transformation.text(0x28, 0x1052, "DS", "0");
        transformation.text(0x28, 0x1053, "DS", one(1 + frame));
        if (segments == 0) groups.sequence(0x28, 0x9145, {transformation});
        segment.short_value(0x62, 0xb, 1 + frame / slices);
        if (segments > 0) groups.sequence(0x62, 0xa, {segment});
        own.push_back(groups);
    }
    data.sequence(0x5200, 0x9230, own);
    return data;
}

/// The high bytes and the low bytes of each frame in literal runs of 128.
std::vector<std::string> run_lengths() {
    std::vector<std::string> packed;
    const std::vector<std::int16_t> values = pixels(slices);
    constexpr std::size_t count = columns * rows, run = 128;
    for (std::size_t frame = 0; frame < slices; ++frame) {
        std::string planes;
        for (const int shift : {8, 0})
            for (std::size_t i = 0; i < count; ++i) {
                if (i % run == 0) planes += static_cast<char>(run - 1);
                planes += static_cast<char>(values[frame * count + i] >> shift);
            }
        std::string header(64, '\0');
        const std::size_t second = 64 + planes.size() / 2;
        header[0] = 2, header[4] = 64;
        header[8] = static_cast<char>(second & 0xffU), header[9] = static_cast<char>(second >> 8U);
        packed.push_back(header + planes);
    }
    return packed;
}

Seed frames_seed(const std::string& name, const char* syntax) {
    const std::string enhanced_ct = "1.2.840.10008.5.1.4.1.1.2.1";
    Elements data = many_frames(enhanced_ct, "CT", 16, 0);
    if (syntax == imaging::test::run_lengths)
        data.fragments(run_lengths());
    else
        data.words(0x7fe0, 0x10, pixels(slices));
    return {{{name, dicom_file(enhanced_ct, data, syntax)}}, name};
}

Seed segmentation() {
    const std::string seg = "1.2.840.10008.5.1.4.1.1.66.4";
    Elements data = many_frames(seg, "SEG", 1, 2);
    std::string bits(static_cast<std::size_t>(columns * rows * slices / 8), '\x11');
    data.bytes_value(0x7fe0, 0x10, bits + std::string(bits.size(), '\x22'));
    return {{{"seg.dcm", dicom_file(seg, data, imaging::test::explicit_little_endian)}}, "seg.dcm"};
}

/// The frames packed by GDCM, lossless.
std::vector<std::string> packed_by_gdcm(gdcm::TransferSyntax::TSType syntax) {
    const std::vector<std::int16_t> values = pixels(slices);
    gdcm::DataElement element(gdcm::Tag(0x7fe0, 0x0010));
    element.SetByteValue(reinterpret_cast<const char*>(values.data()),
                         gdcm::VL(static_cast<std::uint32_t>(2 * values.size())));
    const gdcm::SmartPointer<gdcm::Image> image = new gdcm::Image;  // counts its references
    image->SetNumberOfDimensions(3);
    image->SetDimension(0, columns);
    image->SetDimension(1, rows);
    image->SetDimension(2, slices);
    image->SetPixelFormat(gdcm::PixelFormat(gdcm::PixelFormat::INT16));
    image->SetPhotometricInterpretation(gdcm::PhotometricInterpretation::MONOCHROME2);
    image->SetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
    image->SetDataElement(element);
    gdcm::ImageChangeTransferSyntax change;
    change.SetTransferSyntax(syntax);
    change.SetInput(*image);
    if (!change.Change()) throw std::runtime_error("GDCM cannot pack frames");
    std::vector<std::string> frames;
    const gdcm::SequenceOfFragments* fragments = change.GetOutput().GetDataElement().GetSequenceOfFragments();
    for (std::size_t n = 0; n < fragments->GetNumberOfFragments(); ++n) {
        const gdcm::ByteValue* bytes = fragments->GetFragment(n).GetByteValue();
        frames.emplace_back(bytes->GetPointer(), bytes->GetLength());
    }
    return frames;
}

/// JPEG, JPEG-LS and JPEG 2000.
std::vector<Seed> packed_seeds(const std::filesystem::path&) {
    const std::string enhanced_ct = "1.2.840.10008.5.1.4.1.1.2.1";
    gdcm::Trace::WarningOff();
    std::vector<Seed> seeds;
    for (const auto& [name, syntax] : {std::pair{"jpeg.dcm", gdcm::TransferSyntax::JPEGLosslessProcess14_1},
                                       {"jpeg-ls.dcm", gdcm::TransferSyntax::JPEGLSLossless},
                                       {"jpeg-2000.dcm", gdcm::TransferSyntax::JPEG2000Lossless}}) {
        Elements data = many_frames(enhanced_ct, "CT", 16, 0);
        data.fragments(packed_by_gdcm(syntax));
        const std::string uid = gdcm::TransferSyntax(syntax).GetString();
        seeds.push_back({{{name, dicom_file(enhanced_ct, data, uid.c_str())}}, name});
    }
    return seeds;
}

std::vector<Seed> series_seeds(const std::filesystem::path&) {
    Seed series;
    for (int k = 0; k < slices; ++k) series.files["slice" + std::to_string(k) + ".dcm"] = slice(k);
    return {series};
}

std::vector<Seed> frame_seeds(const std::filesystem::path&) {
    return {frames_seed("plain.dcm", imaging::test::explicit_little_endian),
            frames_seed("deflated.dcm", imaging::test::deflated), frames_seed("rle.dcm", imaging::test::run_lengths),
            segmentation()};
}

/// A box, and an outline that is no tissue.
std::vector<Seed> contour_seeds(const std::filesystem::path&) {
    std::vector<imaging::test::Contour> planes;
    for (int k = 0; k < slices; ++k)
        planes.push_back({{{-5.5, -4, 3.0 * k}, {6, -4, 3.0 * k}, {6, 7.25, 3.0 * k}, {-5.5, 7.25, 3.0 * k}},
                          k == 1 ? "CLOSEDPLANAR_XOR" : "CLOSED_PLANAR"});
    const Elements data = imaging::test::structure_set({{1, "liver", planes}, {2, "BODY", planes, "EXTERNAL"}});
    return {
        {{{"rtss.dcm", dicom_file(imaging::test::structure_set_storage, data, imaging::test::explicit_little_endian)}},
         "rtss.dcm"}};
}

/// Lengths of elements and values of two bytes: they follow upper-case representations.
std::vector<Field> element_fields(const std::string& bytes) {
    const auto upper = [](char c) { return c >= 'A' && c <= 'Z'; };
    std::vector<Field> fields;
    for (std::size_t at = 132; at + 8 < bytes.size(); at += 2) {
        if (!upper(bytes[at]) || !upper(bytes[at + 1])) continue;
        const std::string kind = bytes.substr(at, 2);
        const bool wide = kind == "OW" || kind == "OB" || kind == "SQ" || kind == "UN";
        fields.push_back({wide ? at + 4 : at + 2, wide ? 4 : 2, false});
        if (kind == "US") fields.push_back({at + 4, 2, false});
    }
    return fields;
}

}  // namespace

std::vector<Format> dicom_formats() {
    return {{"dicom-series", series_seeds, read_image, element_fields},
            {"dicom-frames", frame_seeds, read_image, element_fields},
            {"dicom-packed", packed_seeds, read_image, element_fields},
            {"dicom-contours", contour_seeds, read_image, element_fields}};
}

}  // namespace tissuewarp::fuzz
