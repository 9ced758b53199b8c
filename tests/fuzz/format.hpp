#pragma once
/// What the harness knows of a kind of file: files that are right, what reads them, and where its numbers stand.

#include "tests/fuzz/digest.hpp"

#include <cstddef>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace tissuewarp::fuzz {

using Random = std::mt19937_64;

enum class Packing { None, Gzip, Zlib, Deflate };

/// A file as it lies on the disk: `head`, then `body` packed. Both are damaged before packing, so that damage gets past
/// checksums, or the whole of it afterwards.
struct SeedFile {
    std::string head, body;
    Packing packing = Packing::None;
};
std::string bytes_of(const SeedFile& file);

/// Files that belong together, and the one that the reader is given; "" for their folder.
struct Seed {
    std::map<std::string, SeedFile> files;
    std::string named;
    bool must_be_read = false;  ///< it is undamaged
    bool edited = false;        ///< Format::edit is to damage it
};

/// A number of a binary header.
struct Field {
    std::size_t offset = 0;
    int bytes = 4;
    bool real = false;
};

struct Format {
    std::string name;
    /// Files that are read without complaint; the folder may be written to.
    std::function<std::vector<Seed>(const std::filesystem::path& folder)> seeds;
    /// Reads and digests what it got, so that two readings can be compared.
    std::function<void(const std::filesystem::path& path, Digest& digest)> read;
    /// Numbers of the file's binary header; none where it is text.
    std::function<std::vector<Field>(const std::string& bytes)> fields = {};
    /// Damage that only the format's own library can do, to a file on the disk; false where it did none.
    std::function<bool(const std::filesystem::path& file, Random& random)> edit = {};
};

std::vector<Format> image_formats();
std::vector<Format> dicom_formats();
std::vector<Format> surface_formats();
std::vector<Format> mesh_formats();
std::vector<Format> point_formats();
std::vector<Format> toml_formats();
std::vector<Format> transform_formats();
std::vector<Format> model_formats();

/// A seed of one file.
Seed single(const std::string& name, std::string bytes);
/// The bytes of a file; empty where there is none.
std::string bytes_at(const std::filesystem::path& path);

}  // namespace tissuewarp::fuzz
