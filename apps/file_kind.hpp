#pragma once
/// What a file is, by its name.

#include <filesystem>
#include <string>

namespace tissuewarp::apps {

enum class FileKind { Image, Points, Surface, Mesh, Record, Unknown };

inline FileKind file_kind(const std::filesystem::path& path) {
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) return FileKind::Image;  // a DICOM series
    const std::string name = path.filename().string();
    for (const char* extension : {".nii", ".nii.gz", ".nrrd", ".nhdr", ".mha", ".mhd"})
        if (name.ends_with(extension)) return FileKind::Image;
    for (const char* extension : {".csv", ".xyz"})
        if (name.ends_with(extension)) return FileKind::Points;
    for (const char* extension : {".ply", ".stl", ".obj", ".vtk", ".vtp"})
        if (name.ends_with(extension)) return FileKind::Surface;
    if (name.ends_with(".vtu")) return FileKind::Mesh;
    return name.ends_with(".h5") ? FileKind::Record : FileKind::Unknown;
}

}  // namespace tissuewarp::apps
