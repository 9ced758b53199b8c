#include "shaders/program_source.hpp"

#include "core/errors.hpp"

#include <algorithm>
#include <charconv>
#include <optional>
#include <set>
#include <sstream>

namespace tissuewarp::shaders {
namespace {

constexpr std::size_t lines_per_file = 10000;

const std::string& file(const SourceLibrary& library, const std::string& name) {
    const auto found = library.find(name);
    if (found == library.end()) throw InvalidInput("no GLSL file " + name + " in shaders/");
    return found->second;
}

std::string kernel_file(const ProgramSource& source) {
    switch (source.stage) {
        case ShaderStage::Vertex:
            return "render_pass/" + source.kernel + ".vert";
        case ShaderStage::Fragment:
            return "render_pass/" + source.kernel + ".frag";
        case ShaderStage::Compute:
            break;
    }
    return "kernels/" + source.kernel + ".comp";
}

/// Names that a file declares by lines `//! define NAME`.
void collect_declared_names(const std::string& text, std::set<std::string>& names) {
    constexpr std::string_view mark = "//! define ";
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);)
        if (line.starts_with(mark)) {
            std::istringstream rest(line.substr(mark.size()));
            std::string name;
            rest >> name;
            names.insert(name);
        }
}

void require_defines(const ProgramSource& source, const std::set<std::string>& declared) {
    for (const std::string& name : declared)
        if (!source.defines.contains(name))
            throw InvalidInput("kernel " + source.kernel + " needs a value for " + name +
                               ", which a file of it declares");
    for (const auto& [name, value] : source.defines)
        if (!declared.contains(name))
            throw InvalidInput("kernel " + source.kernel + " is given " + name +
                               ", which no file of it declares by `//! define`");
}

/// Where a log line names source and line: characters [begin, end) of it.
struct Position {
    std::size_t begin = 0, end = 0;
    std::size_t line = 0;  ///< 0 when there is none
};

/// Mesa writes "1:23(5): error", NVIDIA "1(23) : error", AMD and glslang "ERROR: 1:23:". By hand, because g++ 12 warns
/// about std::regex under the sanitizers.
Position position_in(std::string_view line) {
    Position found;
    for (const std::string_view prefix : {"ERROR: ", "WARNING: "})
        if (line.starts_with(prefix)) found.begin = prefix.size();
    std::size_t at = found.begin;
    const auto number = [&] {
        std::size_t value = 0;
        const auto parsed = std::from_chars(line.data() + at, line.data() + line.size(), value);
        const auto digits = static_cast<std::size_t>(parsed.ptr - (line.data() + at));
        at += digits;
        return digits > 0 ? std::optional(value) : std::nullopt;
    };
    const auto next_is = [&](char c) { return at < line.size() && line[at] == c; };
    if (!number() || !(next_is(':') || next_is('('))) return {};
    const char separator = line[at++];
    const std::optional<std::size_t> line_number = number();
    if (!line_number || (separator == '(' && !next_is(')'))) return {};
    // Behind "1:23" Mesa adds the column, "(5)", of no use where tabs and macros shift it; NVIDIA closes "1(23)".
    if (separator == '(' || next_is('(')) at = std::min(line.find(')', at), line.size() - 1) + 1;
    found.end = at;
    found.line = *line_number;
    return found;
}

}  // namespace

ComposedSource compose(const ProgramSource& source, const SourceLibrary& library) {
    ComposedSource composed;
    composed.files = {"prolog"};
    for (const std::string& chunk : source.chunks) composed.files.push_back("chunks/" + chunk + ".glsl");
    composed.files.push_back(kernel_file(source));

    std::set<std::string> declared;
    for (std::size_t k = 1; k < composed.files.size(); ++k)
        collect_declared_names(file(library, composed.files[k]), declared);
    require_defines(source, declared);

    std::string& text = composed.text;
    text = "#version 450 core\n";
    for (const std::string& extension : source.extensions) text += "#extension " + extension + " : require\n";
    for (const auto& [name, value] : source.defines) text += "#define " + name + " " + value + "\n";
    for (std::size_t k = 1; k < composed.files.size(); ++k) {
        text += "#line " + std::to_string(k * lines_per_file + 1) + " " + std::to_string(k) + "\n" +
                file(library, composed.files[k]);
        if (!text.ends_with('\n')) text += '\n';
    }
    return composed;
}

std::string program_key(const ProgramSource& source) {
    std::string key = kernel_file(source);
    for (const std::string& chunk : source.chunks) key += "+" + chunk;
    for (const auto& [name, value] : source.defines) key += ";" + name + "=" + value;
    for (const std::string& extension : source.extensions) key += ";" + extension;
    return key;
}

std::string readable_log(std::string_view log, const std::vector<std::string>& files) {
    std::istringstream lines{std::string(log)};
    std::string readable;
    for (std::string line; std::getline(lines, line);) {
        const Position position = position_in(line);
        const std::size_t file_number = position.line / lines_per_file;
        if (file_number > 0 && file_number < files.size())
            line.replace(position.begin, position.end - position.begin,
                         files[file_number] + ":" + std::to_string(position.line % lines_per_file));
        readable += line + "\n";
    }
    return readable;
}

}  // namespace tissuewarp::shaders
