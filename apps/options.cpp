// The parser of the command line: verbs, and the errors of whoever mistypes them.

#include "apps/options.hpp"

#include "apps/option_values.hpp"
#include "apps/verb_options.hpp"
#include "apps/versions.hpp"
#include "core/errors.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <deque>

namespace tissuewarp::apps {

namespace {

/// All verbs with the structs that they fill.
struct Parser {
    CLI::App app{
        "Registers images of soft tissue by simulating the tissue. Lengths in mm, stiffness in kPa, points in LPS.",
        "tissuewarp"};
    RegisterOptions registration;
    PrepareModelOptions prepare;
    UpdatePatientOptions update;
    ServeOptions serve;
    MeshOptions mesh;
    WarpOptions warp;
    ConvertOptions convert;
    CompoundOptions compound;
    EvaluateOptions evaluate;
    InfoOptions info;
    BenchOptions bench;
    SimulateOptions simulate;
    ExplainOptions explain;
    CalibrateOptions calibrate;
    StudyOptions study;
    CohortOptions cohort;
    RegistrationTexts texts, prepare_texts;
    std::vector<std::string> mesh_lengths, info_files;
    std::deque<Verb> verbs;

    Parser() {
        app.require_subcommand(1);
        app.set_version_flag("--version", "tissuewarp " + program_version());
        app.footer(
            "Documents:\n  docs/index.md               In the sources, and in /usr/share/doc/tissuewarp of packages");
        declare_register(verbs.emplace_back(app, "register", "Register a segmented volume to another, or to points"),
                         registration, texts);
        declare_prepare(verbs.emplace_back(app, "prepare", "Make the patient's model before the operation"), prepare,
                        prepare_texts);
        declare_update(verbs.emplace_back(app, "update", "Register a prepared patient to what is seen"), update);
        declare_serve(verbs.emplace_back(app, "serve", "Serve a prepared patient over OpenIGTLink"), serve);
        declare_mesh(verbs.emplace_back(app, "mesh", "Turn a label map into tetrahedra"), mesh, mesh_lengths);
        declare_warp(verbs.emplace_back(app, "warp", "Carry an image, labels, points or a surface along"), warp);
        declare_convert(verbs.emplace_back(app, "convert", "Turn a transform or field into another program's"),
                        convert);
        declare_compound(verbs.emplace_back(app, "compound", "Make a volume of a tracked ultrasound sweep"), compound);
        declare_evaluate(verbs.emplace_back(app, "evaluate", "Score label maps, landmarks, curves and fields"),
                         evaluate);
        declare_info(verbs.emplace_back(app, "info", "Print what a file holds, or the devices of this machine"), info,
                     info_files);
        declare_bench(verbs.emplace_back(app, "bench", "Time the solver's engines on this machine"), bench);
        declare_simulate(verbs.emplace_back(app, "simulate", "Simulate what a scene file names"), simulate);
        declare_explain(verbs.emplace_back(app, "explain", "Print what a scene will run and what a step costs"),
                        explain);
        declare_calibrate(
            verbs.emplace_back(app, "calibrate", "Measure on phantoms what --accuracy and --time-budget choose by"),
            calibrate);
        declare_study(verbs.emplace_back(app, "study", "Measure what accuracy costs in time on this machine"), study);
        declare_cohort(verbs.emplace_back(app, "cohort", "Run a table of pairs here or on a cluster, and sum up"),
                       cohort);
        for (Verb& verb : verbs) verb.arrange(help_layout(verb.name()));
    }

    /// What CLI11 prints, with single blank lines.
    [[nodiscard]] std::string help() const {
        std::string text = app.help();
        for (std::size_t at; (at = text.find("\n\n\n")) != std::string::npos;) text.erase(at, 1);
        return text;
    }

    Command result() {
        Verb& verb = *find(app.get_subcommands().front()->get_name());
        const std::string name = verb.name();
        const auto parameters = [&] { return verb.parameters({"save-parameters", "dry-run"}); };
        if (name == "register") {
            complete_register(registration, texts);
            registration.parameters = parameters();
            return registration;
        }
        if (name == "prepare") {
            complete_prepare(prepare, prepare_texts);
            prepare.parameters = parameters();
            return prepare;
        }
        if (name == "update") {
            complete_update(update.registration);
            update.registration.parameters = parameters();
            update.common = update.registration.common;
            return update;
        }
        if (name == "serve") return serve;
        if (name == "mesh") {
            mesh.label_edge_length = label_lengths(mesh_lengths);
            return mesh;
        }
        if (name == "warp") return warp;
        if (name == "convert") return convert;
        if (name == "compound") return compound;
        if (name == "evaluate") return evaluate;
        if (name == "bench") return bench;
        if (name == "simulate") return simulate;
        if (name == "explain") return explain;
        if (name == "calibrate") return calibrate;
        if (name == "study") return study;
        if (name == "cohort") return cohort;
        info.files.assign(info_files.begin(), info_files.end());
        return info;
    }

    /// The verb of this name, or null.
    Verb* find(const std::string& name) {
        const auto found = std::find_if(verbs.begin(), verbs.end(), [&](const Verb& v) { return v.name() == name; });
        return found == verbs.end() ? nullptr : &*found;
    }

    /// Options of register that one half of it takes and the other does not, or neither.
    void refuse_option_of_other_half(const std::string& verb, const std::string& name) {
        if (verb != "prepare" && verb != "update") return;
        const std::string other = verb == "prepare" ? "update" : "prepare";
        if (find(other)->has(name))
            throw InvalidInput(name + (verb == "update"
                                           ? " makes the model and belongs to prepare; prepare the patient anew with it"
                                           : " belongs to update, which sees the operation; give it there"));
        if (find("register")->has(name))
            throw InvalidInput(fmt::format(
                "{} is an option of register alone: it chooses the mesh by what is seen; give prepare an --edge-length",
                name));
    }

    /// Throws for a verb or a long option that does not exist, with the nearest that does: before CLI11 looks for what
    /// is required, which a misspelt option would seem to lack.
    void refuse_unknown(const std::vector<std::string>& arguments) {
        if (arguments.empty() || arguments.front().starts_with("-")) return;
        Verb* verb = find(arguments.front());
        if (!verb) refuse("there is no verb '" + arguments.front() + "'", arguments.front(), verb_names(), "--help");
        for (const std::string& argument : arguments) {
            const std::string name = argument.substr(0, argument.find('='));
            if (!name.starts_with("--") || verb->has(name)) continue;
            refuse_option_of_other_half(verb->name(), name);
            refuse("there is no option '" + name + "'", name, verb->long_options(), arguments.front() + " --help-all");
        }
    }

    [[noreturn]] static void refuse(const std::string& message, const std::string& word,
                                    const std::vector<std::string>& names, const std::string& help) {
        const std::string nearest = nearest_name(word, names);
        throw InvalidInput(message +
                           (nearest.empty() ? "; see 'tissuewarp " + help + "'" : "; did you mean '" + nearest + "'?"));
    }

    /// The verb that the arguments name, or null.
    Verb* verb_of(const std::vector<std::string>& arguments) {
        return arguments.empty() ? nullptr : find(arguments.front());
    }

    static std::vector<std::string> verb_names() {
        return {"register", "prepare", "update", "serve",    "mesh",    "warp",      "convert", "compound",
                "evaluate", "info",    "bench",  "simulate", "explain", "calibrate", "study",   "cohort"};
    }
};

}  // namespace

Command parse_command_line(std::vector<std::string> arguments) {
    Parser parser;
    const Verb* verb = parser.verb_of(arguments);
    const bool module = verb && verb->is_module();
    if (module) arguments = with_hyphens(std::move(arguments));
    if (verb && verb->has("--config")) arguments = with_config(arguments, verb->known());
    parser.refuse_unknown(arguments);
    if (module && std::find(arguments.begin(), arguments.end(), "--xml") != arguments.end())
        throw HelpRequest{verb->description()};
    std::reverse(arguments.begin(), arguments.end());  // CLI11 takes them last first
    try {
        parser.app.parse(arguments);
    } catch (const CLI::CallForAllHelp&) {
        throw HelpRequest{parser.help()};
    } catch (const CLI::CallForHelp&) {
        for (Verb& other : parser.verbs) other.shorten_help();
        throw HelpRequest{parser.help()};
    } catch (const CLI::CallForVersion&) {
        throw HelpRequest{parser.app.version() + "\n"};
    } catch (const CLI::ParseError& error) {
        const bool no_verb = parser.app.get_subcommands().empty();
        throw InvalidInput(
            no_verb ? "give a verb: register, prepare, update, serve, mesh, warp, convert, compound, "
                      "evaluate, info, bench, simulate, explain, calibrate, study or cohort; see 'tissuewarp --help'"
                    : fmt::format("{}; see 'tissuewarp {} --help-all'", error.what(),
                                  parser.app.get_subcommands().front()->get_name()));
    }
    return parser.result();
}

std::string verb_of(const std::vector<std::string>& arguments) {
    const auto verbs = Parser::verb_names();
    const bool known = !arguments.empty() && std::find(verbs.begin(), verbs.end(), arguments.front()) != verbs.end();
    return known ? arguments.front() : "";
}

}  // namespace tissuewarp::apps
