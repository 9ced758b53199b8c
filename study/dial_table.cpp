#include "core/atomic_file.hpp"
#include "core/errors.hpp"
#include "study/dial_trial.hpp"

#include <fstream>
#include <sstream>
#include <string>

namespace tissuewarp::study {

namespace {

using registration::DataKind;

constexpr const char* header =
    "seed,data,time_budget_s,accuracy_mm,edge_length_mm,expected_s,seconds,error_mm,estimated_mm,possible,announced";

[[noreturn]] void refuse(const std::filesystem::path& path, int line, const std::string& why) {
    throw InvalidInput(path.string() + ", line " + std::to_string(line) + ": " + why +
                       "; remove the file to have it measured again");
}

std::string field(const std::optional<double>& value) {
    std::ostringstream text;
    if (value) text << *value;
    return text.str();
}

DialTrial parsed(const std::string& text, const std::filesystem::path& path, int line) {
    std::istringstream cells(text);
    const auto next = [&] {
        std::string cell;
        if (!std::getline(cells, cell, ',')) refuse(path, line, "a field is missing");
        return cell;
    };
    const auto number = [&](const std::string& cell) {
        std::istringstream stream(cell);
        double value = 0;
        if (!(stream >> value) || !stream.eof()) refuse(path, line, "'" + cell + "' is no number");
        return value;
    };
    const auto wanted = [&](const std::string& cell) {
        return cell.empty() ? std::nullopt : std::optional(number(cell));
    };
    DialTrial trial;
    trial.seed = static_cast<std::uint64_t>(number(next()));
    const std::string kind = next();
    if (kind != name_of(DataKind::Labels) && kind != name_of(DataKind::Partial))
        refuse(path, line, "'" + kind + "' is no kind of data");
    trial.kind = kind == name_of(DataKind::Labels) ? DataKind::Labels : DataKind::Partial;
    trial.request.time_s = wanted(next());
    trial.request.accuracy_mm = wanted(next());
    for (double* value :
         {&trial.edge_length_mm, &trial.expected_s, &trial.seconds, &trial.error_mm, &trial.estimated_mm})
        *value = number(next());
    trial.possible = number(next()) != 0;
    trial.announced = number(next()) != 0;
    return trial;
}

}  // namespace

void write_dial_trials(const std::filesystem::path& path, const std::vector<DialTrial>& trials) {
    AtomicFile file(path);
    std::ofstream out(file.path());
    out << header << '\n';
    for (const DialTrial& t : trials)
        out << t.seed << ',' << name_of(t.kind) << ',' << field(t.request.time_s) << ',' << field(t.request.accuracy_mm)
            << ',' << t.edge_length_mm << ',' << t.expected_s << ',' << t.seconds << ',' << t.error_mm << ','
            << t.estimated_mm << ',' << t.possible << ',' << t.announced << '\n';
    out.close();
    if (!out) throw IoError(path.string() + " cannot be written: is the disk full?");
    file.commit();
}

std::vector<DialTrial> read_dial_trials(const std::filesystem::path& path) {
    std::ifstream in(path);
    if (!in) throw IoError(path.string() + " cannot be read");
    std::string text;
    std::getline(in, text);
    if (text != header) refuse(path, 1, "this is no table of trials, or one of another version");
    std::vector<DialTrial> trials;
    for (int line = 2; std::getline(in, text); ++line) trials.push_back(parsed(text, path, line));
    return trials;
}

}  // namespace tissuewarp::study
