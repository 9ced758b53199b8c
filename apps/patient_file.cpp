#include "apps/patient_file.hpp"

#include "apps/versions.hpp"
#include "core/file_message.hpp"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace tissuewarp::apps {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

constexpr int facts_version = 1;

json parameters_json(const std::vector<Parameter>& parameters) {
    json list = json::array();
    for (const Parameter& parameter : parameters)
        list.push_back(
            {{"name", parameter.name}, {"kind", static_cast<int>(parameter.kind)}, {"values", parameter.values}});
    return list;
}

std::vector<Parameter> parameters_of(const json& list) {
    std::vector<Parameter> parameters;
    for (const json& entry : list) {
        const int kind = entry.at("kind").get<int>();
        const auto values = entry.at("values").get<std::vector<std::string>>();
        if (kind < 0 || kind > static_cast<int>(Parameter::Kind::TextList) || values.empty())
            throw InvalidInput("its parameters are none");
        parameters.push_back({entry.at("name").get<std::string>(), static_cast<Parameter::Kind>(kind), values});
    }
    return parameters;
}

json names_json(const imaging::LabelNames& names) {
    json object = json::object();
    for (const auto& [label, name] : names) object[std::to_string(label)] = name;
    return object;
}

imaging::LabelNames names_of(const json& object) {
    imaging::LabelNames names;
    for (const auto& [label, name] : object.items()) names[std::stoi(label)] = name.get<std::string>();
    return names;
}

json facts_json(const PrepareModelOptions& options, const RegistrationInputs& inputs, const std::string& started) {
    json facts{{"facts_version", facts_version},
               {"parameters", parameters_json(options.parameters)},
               {"for_labels", options.for_labels},
               {"notes", inputs.notes},
               {"label_names", names_json(inputs.label_names)},
               {"moving_label_names", names_json(inputs.moving_label_names)},
               {"provenance", {{"prepared", started}, {"version tissuewarp", program_version()}}}};
    for (const InputFile& file : inputs.files)
        facts["files"].push_back(
            {{"role", file.role}, {"path", fs::absolute(file.path).string()}, {"sha256", file.sha256}});
    facts["tissues"] = json::object();
    for (const auto& [label, tissue] : inputs.materials) facts["tissues"][std::to_string(label)] = tissue.name;
    if (inputs.foreground)
        facts["foreground"] = {{"threshold", inputs.foreground->threshold},
                               {"volume_mm3", inputs.foreground->volume_mm3},
                               {"image_share", inputs.foreground->image_share}};
    return facts;
}

/// The options that these parameters were, by the parser that read them first.
PreoperativeOptions options_of(const std::vector<Parameter>& parameters) {
    std::vector<std::string> arguments{"prepare"};
    for (const Parameter& parameter : parameters) {
        const std::string name = "--" + parameter.name;
        if (parameter.name == "help" || parameter.name == "config")  // no parameters, which a file could ask for
            throw InvalidInput("its parameters are not those of tissuewarp prepare");
        if (parameter.kind == Parameter::Kind::Switch) {
            if (parameter.values.back() == "true") arguments.push_back(name);
            continue;
        }
        for (const std::string& value : parameter.values) arguments.push_back(name + "=" + value);
    }
    return std::get<PrepareModelOptions>(parse_command_line(arguments)).preoperative;
}

void take_facts(PreparedPatient& patient, const json& facts) {
    if (const int version = facts.at("facts_version").get<int>(); version != facts_version)
        throw InvalidInput(fmt::format("its facts are of version {}, and this program knows {}; prepare it anew",
                                       version, facts_version));
    RegistrationInputs& inputs = patient.inputs;
    patient.parameters = parameters_of(facts.at("parameters"));
    patient.options = options_of(patient.parameters);
    patient.for_labels = facts.at("for_labels").get<bool>();
    patient.provenance = facts.at("provenance").get<std::map<std::string, std::string>>();
    inputs.notes = facts.at("notes").get<std::vector<std::string>>();
    inputs.label_names = names_of(facts.at("label_names"));
    inputs.moving_label_names = names_of(facts.at("moving_label_names"));
    for (const auto& [label, name] : facts.at("tissues").items())
        inputs.materials[std::stoi(label)].name = name.get<std::string>();
    for (const json& file : facts.at("files")) {
        inputs.files.push_back({file.at("role").get<std::string>(), file.at("path").get<std::string>(),
                                file.at("sha256").get<std::string>()});
        // From wherever update runs.
        if (inputs.files.back().role == "moving" &&
            inputs.files.back().path.filename() == patient.options.moving.filename())
            patient.options.moving = inputs.files.back().path;
    }
    if (!facts.contains("foreground")) return;
    const json& found = facts.at("foreground");
    inputs.foreground = imaging::Foreground{{},
                                            found.at("threshold").get<double>(),
                                            found.at("volume_mm3").get<double>(),
                                            found.at("image_share").get<double>()};
}

}  // namespace

void write_patient_file(const PrepareModelOptions& options, const RegistrationInputs& inputs,
                        const registration::PreparedModel& model, const std::string& started) {
    const json facts = facts_json(options, inputs, started);
    registration::write_patient(model, inputs.moving, facts.dump(-1, ' ', false, json::error_handler_t::replace),
                                options.output);
}

PreparedPatient read_patient_file(const fs::path& path, Observer& observer) {
    registration::Patient read = registration::read_patient(path, observer);
    PreparedPatient patient;
    patient.model = std::make_unique<registration::PreparedModel>(std::move(read.prepared));
    patient.inputs.moving = std::move(read.image);
    patient.inputs.moving_labels = std::move(read.labels);
    return naming(path, [&] {
        try {
            take_facts(patient, json::parse(read.facts));
        } catch (const json::exception& problem) {
            throw InvalidInput(std::string("its facts are not those of tissuewarp prepare: ") + problem.what());
        } catch (const std::logic_error& problem) {  // std::stoi
            throw InvalidInput(std::string("its labels are no numbers: ") + problem.what());
        }
        return std::move(patient);
    });
}

}  // namespace tissuewarp::apps
