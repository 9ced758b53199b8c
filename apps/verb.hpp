#pragma once
/// One verb of the command line. For options.cpp alone, the one translation unit that includes CLI11.

#include "apps/config_file.hpp"
#include "apps/options.hpp"

#include <CLI/CLI.hpp>

#include <algorithm>

namespace tissuewarp::apps {

/// Declares the options of one verb and remembers of which kind each is.
class Verb {
    using Kind = Parameter::Kind;

public:
    Verb(CLI::App& parent, const char* name, const char* what) : app_(*parent.add_subcommand(name, what)) {
        app_.set_help_flag("-h,--help", "Print this text and exit");
    }
    CLI::App& app() { return app_; }

    CLI::Option* path(const std::string& names, std::filesystem::path& target, const char* what) {
        return keep(Kind::Text, app_.add_option_function<std::string>(
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
        return keep(Kind::Text, app_.add_option_function<std::vector<std::string>>(names, take, what)
                                    ->type_name("FILE")
                                    ->allow_extra_args(false)
                                    ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll));
    }
    CLI::Option* text(const std::string& names, std::string& target, const char* what) {
        return keep(Kind::Text, app_.add_option(names, target, what)->capture_default_str()->take_last());
    }
    /// A number within [least, most], of the unit that `unit` names.
    template <class T>
    CLI::Option* number(const std::string& names, T& target, const char* unit, T least, T most, const char* what) {
        return keep(Kind::Number, app_.add_option(names, target, what)
                                      ->type_name(unit)
                                      ->check(CLI::Range(least, most).description(""))
                                      ->capture_default_str()
                                      ->take_last());
    }
    CLI::Option* flag(const std::string& names, bool& target, const char* what) {
        return keep(Kind::Switch, app_.add_flag(names, target, what)->take_last());
    }
    CLI::Option* list(const std::string& names, std::vector<std::string>& target, const char* unit, const char* what) {
        return keep(Kind::TextList, app_.add_option(names, target, what)->type_name(unit)->allow_extra_args(false));
    }
    void common(CommonOptions& target) {
        number("--threads", target.threads, "COUNT", 0, 4096, "Cores to use; 0: all");
        flag("--quiet", target.quiet, "Print errors only");
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

    [[nodiscard]] KnownOptions known() const {
        KnownOptions result;
        for (const auto& [option, kind] : options_) {
            result.names.push_back(name_of(option));
            if (kind == Kind::Switch) result.switches.push_back(name_of(option));
        }
        return result;
    }
    /// Present values, defaults included; options without a value are left out.
    [[nodiscard]] std::vector<Parameter> parameters(const std::vector<std::string>& except) const {
        std::vector<Parameter> result;
        for (const auto& [option, kind] : options_) {
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
    CLI::Option* keep(Kind kind, CLI::Option* option) {
        options_.emplace_back(option, kind);
        return option;
    }
    static std::string name_of(const CLI::Option* option) { return option->get_lnames().front(); }

    CLI::App& app_;
    std::vector<std::pair<CLI::Option*, Kind>> options_;
};

}  // namespace tissuewarp::apps
