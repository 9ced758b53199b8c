#include "apps/module_description.hpp"

#include "apps/versions.hpp"
#include "core/atomic_file.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>

namespace tissuewarp::apps {

namespace {

using Type = DeclaredOption::Type;

/// What a declaration cannot say of a file: what 3D Slicer shall let the user choose.
struct FileElement {
    std::string tag, attributes;
    bool output = false;
};

const FileElement grey_image{"image", R"( type="scalar")"};
const FileElement label_image{"image", R"( type="label")"};
const FileElement surface{"geometry", R"( type="model" fileExtensions=".vtk,.vtp,.ply,.stl,.obj")"};
const FileElement points{"pointfile", R"( fileExtensions=".mrk.json,.fcsv" coordinateSystem="lps")"};
const FileElement folder{"directory", "", true};

/// By the option's name, or by "verb option" where verbs differ. Files that are not here are input files of any kind.
const std::map<std::string, FileElement>& file_elements() {
    static const std::map<std::string, FileElement> table{
        {"moving", grey_image},
        {"fixed", grey_image},
        {"moving-labels", label_image},
        {"fixed-labels", label_image},
        {"moving-mask", label_image},
        {"fixed-mask", label_image},
        {"moving-surface", surface},
        {"fixed-surface", surface},
        {"surface", surface},
        {"fixed-points", points},
        {"moving-points", points},
        {"landmarks-moving", points},
        {"landmarks-fixed", points},
        {"points", points},
        {"initial-transform", {"transform", R"( fileExtensions=".h5,.tfm,.txt,.mat")"}},
        {"save-parameters", {"file", R"( fileExtensions=".toml")", true}},
        {"json", {"file", R"( fileExtensions=".json")", true}},
        {"register output", folder},
        {"simulate output", folder},
        {"mesh labels", label_image},
        {"mesh output", {"geometry", R"( type="model" fileExtensions=".vtu")", true}},
        {"warp input", {"image", R"( type="any")"}},
        {"warp output", {"image", R"( type="any" reference="input")", true}},
        {"warp reference", grey_image}};
    return table;
}

FileElement file_element(const std::string& verb, const std::string& name) {
    const auto& table = file_elements();
    for (const std::string& key : {verb + " " + name, name})
        if (const auto entry = table.find(key); entry != table.end()) return entry->second;
    return {"file", ""};
}

/// What a verb returns in --returnparameterfile.
struct ReturnedParameter {
    std::string tag, name, description;
};

std::vector<ReturnedParameter> returned_parameters(const std::string& verb) {
    if (verb == "register") return {{"string", "doubts", "Reasons not to trust the result, by their codes; or none"}};
    if (verb == "mesh") return {{"integer", "tetrahedra", "Tetrahedra of the mesh"}};
    return {};
}

bool left_out(const std::string& name) {
    static const std::vector<std::string> names{"dry-run", "quiet", "init", "ablate"};
    return std::find(names.begin(), names.end(), name) != names.end();
}

std::string escaped(const std::string& text) {
    static const std::map<char, std::string> entities{{'&', "&amp;"}, {'<', "&lt;"}, {'>', "&gt;"}, {'"', "&quot;"}};
    std::string result;
    for (const char c : text) {
        const auto entity = entities.find(c);
        result += entity == entities.end() ? std::string(1, c) : entity->second;
    }
    return result;
}

std::string element(const std::string& tag, const std::string& text) {
    return fmt::format("<{0}>{1}</{0}>\n", tag, escaped(text));
}

std::string underscored(std::string name) {
    std::replace(name.begin(), name.end(), '-', '_');
    return name;
}

std::string label_of(std::string name) {
    std::replace(name.begin(), name.end(), '-', ' ');
    std::replace(name.begin(), name.end(), '_', ' ');
    name.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(name.front())));
    return name;
}

std::string tag_of(Type type) {
    switch (type) {
        case Type::Choice:
            return "string-enumeration";
        case Type::Integer:
            return "integer";
        case Type::Real:
            return "double";
        case Type::Switch:
            return "boolean";
        case Type::List:
            return "string-vector";
        case Type::File:
        case Type::Text:
            break;
    }
    return "string";
}

/// The step of a spin box, small enough that it keeps the default: 0.01 for 0.05.
std::string step_of(const DeclaredOption& option) {
    if (option.type == Type::Integer) return "1";
    const auto point = option.default_text.find('.');
    const std::size_t digits = point == std::string::npos ? 1 : option.default_text.size() - point - 1;
    return "0." + std::string(digits - 1, '0') + "1";
}

std::string constraints(const DeclaredOption& option) {
    if (option.type != Type::Integer && option.type != Type::Real) return "";
    return "<constraints>\n" + element("minimum", option.least) + element("maximum", option.most) +
           element("step", step_of(option)) + "</constraints>\n";
}

/// `index` counts the positionals.
std::string flags(const DeclaredOption& option, int& index) {
    if (option.positional) return element("index", std::to_string(index++));
    const std::string letter = option.short_name.empty() ? "" : element("flag", option.short_name);
    return letter + element("longflag", underscored(option.name));
}

std::string default_of(const DeclaredOption& option) {
    if (option.type == Type::Switch) return element("default", "false");
    return option.type == Type::File ? "" : element("default", option.default_text);
}

std::string parameter(const DeclaredOption& option, const FileElement& file, int& index) {
    std::string choices;
    for (const std::string& choice : option.choices) choices += element("element", choice);
    const std::string channel =
        option.type == Type::File ? element("channel", file.output ? "output" : "input") : std::string();
    return fmt::format("<{}{}>\n{}</{}>\n", file.tag, file.attributes,
                       element("name", underscored(option.name)) + flags(option, index) +
                           element("label", label_of(option.name)) + element("description", option.description) +
                           channel + default_of(option) + choices + constraints(option),
                       file.tag);
}

std::string parameter(const ReturnedParameter& returned) {
    return fmt::format("<{0}>\n{1}</{0}>\n", returned.tag,
                       element("name", returned.name) + element("label", label_of(returned.name)) +
                           element("description", returned.description) + element("channel", "output") +
                           element("default", returned.tag == "integer" ? "0" : ""));
}

std::string group(const std::string& label, const std::string& attributes, const std::string& members) {
    if (members.empty()) return "";
    return fmt::format("<parameters{}>\n{}{}</parameters>\n", attributes,
                       element("label", label) + element("description", label), members);
}

}  // namespace

std::string module_description(const std::string& verb, const std::string& what,
                               const std::vector<DeclaredOption>& options) {
    std::string inputs, outputs, settings;
    int index = 0;
    for (const DeclaredOption& option : options) {
        if (left_out(option.name)) continue;
        const bool is_file = option.type == Type::File;
        const FileElement file = is_file ? file_element(verb, option.name) : FileElement{tag_of(option.type), ""};
        (!is_file ? settings : file.output ? outputs : inputs) += parameter(option, file, index);
    }
    for (const ReturnedParameter& returned : returned_parameters(verb)) outputs += parameter(returned);
    return "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<executable>\n" +
           element("category", "Registration.tissuewarp") + element("title", "tissuewarp " + verb) +
           element("description", what) + element("version", program_version()) + element("license", "GPL") +
           element("contributor", "tissuewarp maintainers") + group("Inputs", "", inputs) +
           group("Outputs", "", outputs) + group("Settings", " advanced=\"true\"", settings) + "</executable>\n";
}

std::vector<std::string> with_hyphens(std::vector<std::string> arguments) {
    for (std::string& argument : arguments) {
        if (!argument.starts_with("--")) continue;
        const auto name_end =
            argument.begin() + static_cast<std::ptrdiff_t>(std::min(argument.find('='), argument.size()));
        std::replace(argument.begin(), name_end, '_', '-');
    }
    return arguments;
}

void write_return_parameters(const std::filesystem::path& path,
                             const std::vector<std::pair<std::string, std::string>>& values) {
    if (path.empty()) return;
    AtomicFile file(path);
    std::ofstream stream(file.path());
    for (const auto& [name, value] : values) stream << name << " = " << value << '\n';
    stream.close();
    if (!stream) throw IoError("cannot write '" + path.string() + "'; is the disk full?");
    file.commit();
}

}  // namespace tissuewarp::apps
