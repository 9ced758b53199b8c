#pragma once
/// One verb of the command line. For options.cpp and verb_options_*.cpp, which alone include CLI11.

#include "apps/config_file.hpp"
#include "apps/module_description.hpp"
#include "apps/option_groups.hpp"
#include "apps/options.hpp"

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include <algorithm>
#include <type_traits>

namespace tissuewarp::apps {

/// Declares the options of one verb and remembers of which kind each is.
class Verb {
    using Kind = Parameter::Kind;
    using Type = DeclaredOption::Type;

public:
    Verb(CLI::App& parent, const char* name, const char* what) : app_(*parent.add_subcommand(name, what)) {
        app_.set_help_flag("-h,--help", "Print this text and exit");
        app_.set_help_all_flag("--help-all", "Print every option and exit");
    }
    /// After the declarations: headings, and what --help keeps of them.
    void arrange(const HelpLayout& layout) {
        for (const OptionGroup& group : layout.groups)
            for (const std::string& option : group.options) app_.get_option(option)->group(group.name);
        first_ = layout.first;
    }
    /// Leaves in the help what people need first, and says where the rest is.
    void shorten_help() {
        if (first_.empty()) return;
        std::vector<CLI::Option*> hidden;
        for (CLI::Option* option : app_.get_options())
            if (option != app_.get_help_ptr() && !is_first(*option)) hidden.push_back(option);
        for (CLI::Option* option : hidden) option->group("");
        for (CLI::Option* option : app_.get_options())  // of what is shown, no word of what is not
            for (CLI::Option* other : hidden) option->remove_excludes(other);
        app_.footer(fmt::format("{}\n\nMore:\n  {:<34}every option, by purpose\n  {:<34}the page of this verb",
                                app_.get_footer(), "tissuewarp " + name() + " --help-all",
                                "docs/manual/" + name() + ".md"));
    }
    CLI::App& app() { return app_; }
    [[nodiscard]] std::string name() const { return app_.get_name(); }

    CLI::Option* path(const std::string& names, std::filesystem::path& target, const char* what) {
        return keep(Kind::Text, Type::File,
                    app_.add_option_function<std::string>(
                            names, [&target](const std::string& value) { target = value; }, what)
                        ->type_name("FILE")
                        ->take_last());
    }
    /// A file, and more of them where the option is repeated.
    CLI::Option* paths(const std::string& names, std::filesystem::path& first, std::vector<std::filesystem::path>& rest,
                       const char* what) {
        const auto take = [&first, &rest](const std::vector<std::string>& values) {
            first = values.front();
            rest.assign(values.begin() + 1, values.end());
        };
        return keep(Kind::Text, Type::File,
                    app_.add_option_function<std::vector<std::string>>(names, take, what)
                        ->type_name("FILE")
                        ->allow_extra_args(false)
                        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll));
    }
    CLI::Option* text(const std::string& names, std::string& target, const char* what) {
        return keep(Kind::Text, Type::Text, app_.add_option(names, target, what)->capture_default_str()->take_last());
    }
    /// One of the words in `choices`.
    CLI::Option* choice(const std::string& names, std::string& target, const std::vector<std::string>& choices,
                        const char* what) {
        CLI::Option* option = text(names, target, what)->check(CLI::IsMember(choices).description(""));
        options_.back().facts.type = Type::Choice;
        options_.back().facts.choices = choices;
        return option;
    }
    /// A number within [least, most], of the unit that `unit` names.
    template <class T>
    CLI::Option* number(const std::string& names, T& target, const char* unit, T least, T most, const char* what) {
        CLI::Option* option = keep(Kind::Number, std::is_integral_v<T> ? Type::Integer : Type::Real,
                                   app_.add_option(names, target, what)
                                       ->type_name(unit)
                                       ->check(CLI::Range(least, most).description(""))
                                       ->capture_default_str()
                                       ->take_last());
        options_.back().facts.least = fmt::format("{}", least);
        options_.back().facts.most = fmt::format("{}", most);
        return option;
    }
    CLI::Option* flag(const std::string& names, bool& target, const char* what) {
        return keep(Kind::Switch, Type::Switch, app_.add_flag(names, target, what)->take_last());
    }
    template <class T>
    CLI::Option* list(const std::string& names, std::vector<T>& target, const char* unit, const char* what) {
        return keep(Kind::TextList, Type::List,
                    app_.add_option(names, target, what)->type_name(unit)->allow_extra_args(false));
    }
    void common(CommonOptions& target) {
        number("--threads", target.threads, "COUNT", 0, 4096, "Cores to use; 0: all");
        flag("--quiet", target.quiet, "Print errors only");
    }
    /// A verb that 3D Slicer can run as a command-line module. Hidden: its execution model says these, not people.
    void module(CommonOptions& target) {
        app_.add_flag("--xml")->description("Print the description of this command-line module")->group("");
        app_.add_option_function<std::string>(
                "--returnparameterfile", [&target](const std::string& value) { target.return_parameters = value; },
                "File for what 3D Slicer reads back")
            ->take_last()
            ->group("");
        app_.add_option("--processinformationaddress", target.process_information, "Accepted; not written to")
            ->take_last()
            ->group("");
    }
    [[nodiscard]] bool is_module() const { return app_.get_option_no_throw("--xml") != nullptr; }
    [[nodiscard]] std::string description() const {
        return module_description(app_.get_name(), app_.get_description(), declared());
    }
    void landmarks(LandmarkFiles& target) {
        CLI::Option* csv =
            path("--landmarks", target.csv,
                 "Corresponding points for scoring only: CSV pre_x,pre_y,pre_z,intra_x,intra_y,intra_z (mm, LPS)");
        CLI::Option* moving = path("--landmarks-moving", target.moving,
                                   "points of the moving image: elastix or 3D Slicer (.mrk.json, .fcsv)");
        CLI::Option* fixed = path("--landmarks-fixed", target.fixed, "points of the fixed image, likewise");
        moving->needs(fixed)->excludes(csv);
        fixed->needs(moving)->excludes(csv);
    }

    /// "--long" options, help among them.
    [[nodiscard]] std::vector<std::string> long_options() const {
        std::vector<std::string> names;
        for (const CLI::Option* option : static_cast<const CLI::App&>(app_).get_options())
            for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
        return names;
    }
    [[nodiscard]] bool has(const std::string& name) const {
        const std::vector<std::string> names = long_options();
        return std::find(names.begin(), names.end(), name) != names.end();
    }
    [[nodiscard]] KnownOptions known() const {
        KnownOptions result;
        for (const auto& [option, kind, facts] : options_) {
            if (option->get_positional()) continue;
            result.names.push_back(name_of(option));
            if (kind == Kind::Switch) result.switches.push_back(name_of(option));
        }
        return result;
    }
    /// Present values, defaults included; options without a value are left out.
    [[nodiscard]] std::vector<Parameter> parameters(const std::vector<std::string>& except) const {
        std::vector<Parameter> result;
        for (const auto& [option, kind, facts] : options_) {
            if (option->get_positional()) continue;
            Parameter parameter{name_of(option), kind, {}};
            if (std::find(except.begin(), except.end(), parameter.name) != except.end()) continue;
            if (option->count() > 0)
                parameter.values = option->results();
            else if (kind == Kind::Switch)
                parameter.values = {"false"};
            else if (!option->get_default_str().empty() && kind != Kind::TextList)
                parameter.values = {option->get_default_str()};
            if (parameter.values.empty()) continue;
            const bool all = option->get_multi_option_policy() == CLI::MultiOptionPolicy::TakeAll;
            if (all && parameter.values.size() > 1) parameter.kind = Kind::TextList;
            if (parameter.kind != Kind::TextList) parameter.values = {parameter.values.back()};
            result.push_back(parameter);
        }
        return result;
    }

private:
    struct Declared {
        CLI::Option* option;
        Kind kind;
        DeclaredOption facts;  // type, choices and limits; declared() adds the rest
    };
    CLI::Option* keep(Kind kind, Type type, CLI::Option* option) {
        options_.push_back({option, kind, {}});
        options_.back().facts.type = type;
        return option;
    }
    [[nodiscard]] std::vector<DeclaredOption> declared() const {
        std::vector<DeclaredOption> result;
        for (const auto& [option, kind, facts] : options_) {
            DeclaredOption& entry = result.emplace_back(facts);
            entry.positional = option->get_positional();
            entry.name = entry.positional ? option->get_name(true) : name_of(option);
            if (!option->get_snames().empty()) entry.short_name = option->get_snames().front();
            entry.description = option->get_description();
            entry.default_text = option->get_default_str();
        }
        return result;
    }
    static std::string name_of(const CLI::Option* option) { return option->get_lnames().front(); }

    [[nodiscard]] bool is_first(const CLI::Option& option) const {
        return !option.get_lnames().empty() &&
               std::find(first_.begin(), first_.end(), "--" + name_of(&option)) != first_.end();
    }

    CLI::App& app_;
    std::vector<Declared> options_;
    std::vector<std::string> first_;  ///< what --help shows; empty: everything
};

}  // namespace tissuewarp::apps
