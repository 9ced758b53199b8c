#pragma once
/// What a file is, by its name in any case; DICOM files, which may have any name, by their first bytes.

#include "imaging/image_io.hpp"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <string>

namespace tissuewarp::apps {

enum class FileKind { Image, Points, Surface, Mesh, Record, Patient, Unknown };

inline FileKind file_kind(const std::filesystem::path& path) {
    std::string name = path.filename().string();
    std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) { return std::tolower(c); });
    for (const char* extension : {".csv", ".xyz", ".fcsv", ".mrk.json"})
        if (name.ends_with(extension)) return FileKind::Points;
    for (const char* extension : {".ply", ".stl", ".obj", ".vtk", ".vtp"})
        if (name.ends_with(extension)) return FileKind::Surface;
    if (name.ends_with(".vtu")) return FileKind::Mesh;
    if (name.ends_with(".h5")) return FileKind::Record;
    if (name.ends_with(".tw")) return FileKind::Patient;
    return imaging::is_image(path) ? FileKind::Image : FileKind::Unknown;
}

}  // namespace tissuewarp::apps
