#include "core/atomic_file.hpp"
#include "study/detail/table.hpp"
#include "study/dial_trial.hpp"

namespace tissuewarp::study {

namespace {

using registration::DataKind;

constexpr const char* header =
    "seed,data,time_budget_s,accuracy_mm,edge_length_mm,expected_s,seconds,error_mm,estimated_mm,possible,announced";

std::string field(const std::optional<double>& value) {
    std::ostringstream text;
    if (value) text << *value;
    return text.str();
}

DialTrial parsed(detail::TableLine& line) {
    const auto wanted = [&] {
        const std::string field = line.next();
        return field.empty() ? std::nullopt : std::optional(line.number(field));
    };
    DialTrial trial;
    trial.seed = static_cast<std::uint64_t>(line.number());
    const std::string kind = line.next();
    if (kind != name_of(DataKind::Labels) && kind != name_of(DataKind::Partial))
        line.refuse("'" + kind + "' is no kind of data");
    trial.kind = kind == name_of(DataKind::Labels) ? DataKind::Labels : DataKind::Partial;
    trial.request.time_s = wanted();
    trial.request.accuracy_mm = wanted();
    for (double* value :
         {&trial.edge_length_mm, &trial.expected_s, &trial.seconds, &trial.error_mm, &trial.estimated_mm})
        *value = line.number();
    trial.possible = line.number() != 0;
    trial.announced = line.number() != 0;
    return trial;
}

}  // namespace

void write_dial_trials(const std::filesystem::path& path, const std::vector<DialTrial>& trials) {
    std::ostringstream out;
    out << header << '\n';
    for (const DialTrial& t : trials)
        out << t.seed << ',' << name_of(t.kind) << ',' << field(t.request.time_s) << ',' << field(t.request.accuracy_mm)
            << ',' << t.edge_length_mm << ',' << t.expected_s << ',' << t.seconds << ',' << t.error_mm << ','
            << t.estimated_mm << ',' << t.possible << ',' << t.announced << '\n';
    write_file(out.str(), path);
}

std::vector<DialTrial> read_dial_trials(const std::filesystem::path& path) {
    std::vector<DialTrial> trials;
    for (detail::TableLine& line : detail::read_table(path, header)) trials.push_back(parsed(line));
    return trials;
}

}  // namespace tissuewarp::study
