#include "tled/step_shape_cache.hpp"

#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "core/user_cache.hpp"
#include "shaders/device.hpp"
#include "tled/detail/step_shapes.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>
#include <tuple>

namespace tissuewarp::tled {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view head =
    "# shapes of GPU steps measured by tissuewarp bench --tune\n"
    "# device\tdriver\telement\ttetrahedra\tpatch_tets\tlongest_fan\tworkgroup\tat_once\tseconds_per_step\n";
constexpr std::size_t columns = 9;
constexpr std::size_t most_lines = 10000, longest_line = 2000;

const char* name_of(Element element) {
    return element == Element::T4 ? "t4" : "averaged";
}

/// A name of a driver must not break lines or columns.
std::string in_one_column(std::string text) {
    for (char& c : text)
        if (c == '\t' || c == '\n' || c == '\r') c = ' ';
    return text;
}

std::optional<std::array<std::string_view, columns>> columns_of(std::string_view line) {
    std::array<std::string_view, columns> parts;
    for (std::size_t i = 0; i < columns; ++i) {
        const std::size_t end = line.find('\t');
        if ((end == std::string_view::npos) != (i + 1 == columns)) return std::nullopt;
        parts[i] = line.substr(0, end);
        line.remove_prefix(std::min(line.size(), parts[i].size() + 1));
    }
    return parts;
}

/// Whether the whole text is a number in [least, most]; NaN is in no range.
template <class Number>
bool read_number(std::string_view text, Number least, Number most, Number& number) {
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
    return fault == std::errc{} && end == text.data() + text.size() && number >= least && number <= most;
}

bool read_shape(const std::array<std::string_view, columns>& part, GpuStepShape& shape) {
    constexpr int least_patch = 32, largest_patch = 65536, largest_workgroup = 1024, most_at_once = 100000;
    return read_number(part[4], 0, largest_patch, shape.patch_tets) &&
           (shape.patch_tets == 0 || shape.patch_tets >= least_patch) &&
           read_number(part[5], 1, 5, shape.longest_fan) &&
           read_number(part[6], 1, largest_workgroup, shape.workgroup) &&
           read_number(part[7], 0, most_at_once, shape.at_once);
}

std::optional<MeasuredStepShape> parsed(std::string_view line) {
    constexpr int most_tetrahedra = 1000000000;
    constexpr double least_seconds = 1e-9, most_seconds = 1e4;
    const auto part = columns_of(line);
    if (!part) return std::nullopt;
    MeasuredStepShape measured{std::string((*part)[0]), std::string((*part)[1])};
    if ((*part)[2] == name_of(Element::AveragedPressureT4))
        measured.element = Element::AveragedPressureT4;
    else if ((*part)[2] != name_of(Element::T4))
        return std::nullopt;
    if (!read_number((*part)[3], 1, most_tetrahedra, measured.tetrahedra) || !read_shape(*part, measured.shape) ||
        !read_number((*part)[8], least_seconds, most_seconds, measured.seconds_per_step))
        return std::nullopt;
    return measured;
}

/// Longer lines than any measurement gives become one that cannot be used; nothing at the end.
std::optional<std::string> next_line(std::istream& file) {
    std::string line(longest_line, '\0');
    file.getline(line.data(), static_cast<std::streamsize>(line.size()));
    if (file.gcount() == 0 && !file) return std::nullopt;
    if (file.fail() && !file.eof()) {
        file.clear();
        file.ignore(std::numeric_limits<std::streamsize>::max(), '\n');
        return "too long";
    }
    // The end of the line was counted too, unless the file ends without one.
    line.resize(static_cast<std::size_t>(file.gcount()) - (file.eof() ? 0 : 1));
    return line;
}

/// Tetrahedra that a workgroup has room for, of several on a multiprocessor its part (suggested_gpu_step_shape).
int largest_patch(const GpuStepShape& shape, Element element, int multiprocessors) {
    const int alone = detail::largest_patch_tets(element);
    if (multiprocessors <= 0 || shape.at_once <= multiprocessors) return alone;
    return alone / ((shape.at_once + multiprocessors - 1) / multiprocessors);
}

double ratio(int a, int b) {
    return a < b ? double(b) / a : double(a) / b;
}

}  // namespace

StepDevice step_device(int device) {
    const shaders::Device found(device);
    return {found.renderer(), found.version(), found.limits().multiprocessors, found.hardware()};
}

Element element_of(const RestState& rest) {
    return rest.pressure.count() > 0 ? Element::AveragedPressureT4 : Element::T4;
}

fs::path step_shape_cache_path() {
    return user_cache_file("gpu_step_shapes.tsv");
}

StepShapeCache read_step_shape_cache(const fs::path& path) {
    StepShapeCache cache;
    std::error_code ignored;
    if (path.empty() || !fs::is_regular_file(path, ignored)) return cache;
    std::ifstream file(path, std::ios::binary);
    std::size_t lines = 0;
    while (const std::optional<std::string> line = next_line(file)) {
        if (++lines > most_lines) {
            ++cache.skipped;
            break;
        }
        if (line->empty() || line->front() == '#') continue;
        if (std::optional<MeasuredStepShape> measured = parsed(*line))
            cache.shapes.push_back(std::move(*measured));
        else
            ++cache.skipped;
    }
    return cache;
}

void write_step_shape_cache(const StepShapeCache& cache, const fs::path& path) {
    if (path.empty())
        throw IoError("no place for measured shapes of GPU steps: neither TISSUEWARP_CACHE nor HOME is set");
    std::error_code failure;
    if (path.has_parent_path()) fs::create_directories(path.parent_path(), failure);
    if (failure)
        throw IoError("cannot create the folder '" + path.parent_path().string() + "': " + failure.message() +
                      "; set TISSUEWARP_CACHE to another");
    AtomicFile file(path);
    std::ofstream stream(file.path(), std::ios::binary);
    stream.precision(6);
    stream << head;
    for (const MeasuredStepShape& m : cache.shapes)
        stream << in_one_column(m.device) << '\t' << in_one_column(m.driver) << '\t' << name_of(m.element) << '\t'
               << m.tetrahedra << '\t' << m.shape.patch_tets << '\t' << m.shape.longest_fan << '\t' << m.shape.workgroup
               << '\t' << m.shape.at_once << '\t' << m.seconds_per_step << '\n';
    stream.close();
    if (!stream) throw IoError("cannot write '" + path.string() + "'; set TISSUEWARP_CACHE to another folder");
    file.commit();
}

void keep(StepShapeCache& cache, MeasuredStepShape measured) {
    measured.device = in_one_column(std::move(measured.device));
    measured.driver = in_one_column(std::move(measured.driver));
    const auto key = [](const MeasuredStepShape& m) { return std::tie(m.device, m.driver, m.element, m.tetrahedra); };
    std::erase_if(cache.shapes, [&](const MeasuredStepShape& older) { return key(older) == key(measured); });
    cache.shapes.push_back(std::move(measured));
}

KnownStepShape best_known_gpu_step_shape(int element_count, Element element, const StepDevice& device,
                                         const StepShapeCache& cache) {
    constexpr double furthest = 1.5;
    const KnownStepShape suggested{suggested_gpu_step_shape(element_count, element, device.multiprocessors)};
    const std::string name = in_one_column(device.name), driver = in_one_column(device.driver);
    const MeasuredStepShape* nearest = nullptr;
    for (const MeasuredStepShape& m : cache.shapes) {
        if (m.device != name || m.driver != driver || m.element != element || element_count <= 0 ||
            ratio(m.tetrahedra, element_count) > furthest)
            continue;
        if (nearest == nullptr || ratio(m.tetrahedra, element_count) < ratio(nearest->tetrahedra, element_count))
            nearest = &m;
    }
    if (nearest == nullptr) return suggested;
    GpuStepShape shape = nearest->shape;
    if (shape.patch_tets > 0 && nearest->tetrahedra != element_count) {
        const int patches = (nearest->tetrahedra - 1) / shape.patch_tets + 1;
        shape.patch_tets = (element_count - 1) / patches + 1;
        const int room = largest_patch(shape, element, device.multiprocessors);
        if (shape.patch_tets > std::max(nearest->shape.patch_tets, room)) return suggested;
    }
    return {shape, true};
}

std::string name_of(const GpuStepShape& shape) {
    if (shape.patch_tets == 0) return "two passes";
    std::string name = std::to_string(shape.patch_tets) + ':' + std::to_string(shape.longest_fan) + ':' +
                       std::to_string(shape.workgroup);
    if (shape.at_once > 0) name += ':' + std::to_string(shape.at_once);
    return name;
}

}  // namespace tissuewarp::tled
