#include "report/page.hpp"

#include "report/detail/encoding.hpp"
#include "report/detail/picture.hpp"
#include "report/detail/slice_stack.hpp"
#include "report/detail/template.hpp"
#include "report/detail/view.hpp"

#include "core/atomic_file.hpp"

#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace tissuewarp::report {

namespace {

/// The slice nearest to where tissue moved most, or the middle one.
std::size_t first_shown(const nlohmann::json& stack, const std::optional<detail::Focus>& focus) {
    std::size_t best = stack.size() / 2;
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; focus && k < stack.size(); ++k) {
        const double distance = std::abs(std::stod(stack[k]["mm"].get<std::string>()) - focus->fixed[2]);
        if (distance < nearest) {
            nearest = distance;
            best = k;
        }
    }
    return best;
}

nlohmann::json page_values(const ReportInput& input, const detail::Preview& preview,
                           const std::vector<unsigned char>& png) {
    nlohmann::json values = detail::view_of(input.report);
    values["preview"] = detail::base64(png);
    if (preview.focus) {
        char millimetres[32];
        std::snprintf(millimetres, sizeof millimetres, "%.1f", preview.focus->displacement);
        values["summary"]["displacement"] = {{"largest", millimetres},
                                             {"beyond_alignment", input.report.contains("alignment")}};
    }
    constexpr int slices = 20;  // a page below 3 MB
    const nlohmann::json stack = detail::slice_stack(input, slices);
    if (!stack.empty())
        values["viewer"] = {
            {"slices", stack}, {"last", stack.size() - 1}, {"first", first_shown(stack, preview.focus)}};
    return values;
}

}  // namespace

void write_report(const ReportInput& input, const std::filesystem::path& folder) {
    const detail::Preview preview = detail::draw_preview(input);
    const std::vector<unsigned char> png = detail::png(preview.picture);
    write_file({reinterpret_cast<const char*>(png.data()), png.size()}, folder / "preview.png");
    write_file(detail::fill(detail::page_template(), page_values(input, preview, png)), folder / "report.html");
}

}  // namespace tissuewarp::report
