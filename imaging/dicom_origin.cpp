#include "imaging/dicom_origin.hpp"

#include "core/errors.hpp"
#include "imaging/detail/dicom.hpp"
#include "imaging/detail/dicom_set.hpp"

#include <algorithm>
#include <array>

namespace tissuewarp::imaging {
namespace fs = std::filesystem;

namespace {

constexpr detail::DicomTag pixel_data = 0x7fe00010, rows = 0x00280010;

/// Character set; study's date, time, accession number, referring physician; patient's name, number, birth date, sex;
/// study's number.
constexpr std::array<detail::DicomTag, 10> repeated_tags{0x00080005, 0x00080020, 0x00080030, 0x00080050, 0x00080090,
                                                         0x00100010, 0x00100020, 0x00100030, 0x00100040, 0x00200010};

std::vector<fs::path> files_of(const fs::path& path) {
    if (!fs::is_directory(path)) return {path};
    std::vector<fs::path> files;
    for (const fs::directory_entry& entry : fs::directory_iterator(path))
        if (entry.is_regular_file() && detail::is_dicom_file(entry.path())) files.push_back(entry.path());
    std::sort(files.begin(), files.end());
    return files;
}

DicomInstance instance_of(const detail::DicomSet& set) {
    DicomInstance instance{set.text(0x00080016), set.text(0x00080018), {}};
    if (const auto p = set.numbers(0x00200032, 3)) instance.position = Eigen::Vector3d((*p)[0], (*p)[1], (*p)[2]);
    return instance;
}

}  // namespace

bool is_dicom(const fs::path& path) {
    std::error_code ignored;
    return fs::is_directory(path, ignored) || detail::is_dicom_file(path);
}

DicomOrigin read_dicom_origin(const fs::path& path) {
    DicomOrigin origin;
    for (const fs::path& file : files_of(path)) {
        const detail::DicomBytes bytes(file);
        const detail::DicomSet& set = bytes.set;
        if (!set.contains(pixel_data) && !set.contains(rows)) continue;  // a plan, or a report
        if (origin.instances.empty()) {
            origin.frame_of_reference = set.text(0x00200052);
            origin.study = set.text(0x0020000d);
            origin.series = set.text(0x0020000e);
            for (const detail::DicomTag tag : repeated_tags)
                if (set.contains(tag)) origin.repeated[tag] = set.text(tag);
        }
        origin.instances.push_back(instance_of(set));
    }
    if (origin.instances.empty()) throw InvalidInput("'" + path.string() + "' holds no DICOM images");
    if (origin.frame_of_reference.empty())
        throw InvalidInput("'" + path.string() +
                           "' states no Frame of Reference UID (0020,0052), to which derived objects belong; export "
                           "the series again");
    return origin;
}

}  // namespace tissuewarp::imaging
