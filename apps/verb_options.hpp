#pragma once
/// The options that each verb declares, and what some of them must agree on. For options.cpp.

#include "apps/verb.hpp"

namespace tissuewarp::apps {

inline constexpr const char* label_names_text =
    "Names of the labels: a colour table of 3D Slicer (.ctbl, .txt, .csv) or a label file of ITK-SNAP";

/// Values of options that are more than text, as the command line gives them.
struct RegistrationTexts {
    std::vector<std::string> label_lengths, anchors, rigid_neighbours, resected, sliding, tissues;
    std::string accuracy, time_budget;
};

void declare_register(Verb& verb, RegisterOptions& o, RegistrationTexts& texts);
void declare_prepare(Verb& verb, PrepareModelOptions& o, RegistrationTexts& texts);
void declare_update(Verb& verb, UpdatePatientOptions& o);
void declare_serve(Verb& verb, ServeOptions& o);

/// Fills in what the texts say, and refuses options that contradict each other. Throw InvalidInput.
void complete_register(RegisterOptions& o, const RegistrationTexts& texts);
void complete_prepare(PrepareModelOptions& o, const RegistrationTexts& texts);
void complete_update(RegisterOptions& o);

void declare_mesh(Verb& verb, MeshOptions& o, std::vector<std::string>& mesh_lengths);
void declare_warp(Verb& verb, WarpOptions& o);
void declare_convert(Verb& verb, ConvertOptions& o);
void declare_compound(Verb& verb, CompoundOptions& o);
void declare_evaluate(Verb& verb, EvaluateOptions& o);
void declare_info(Verb& verb, InfoOptions& o, std::vector<std::string>& info_files);
void declare_bench(Verb& verb, BenchOptions& o);
void declare_simulate(Verb& verb, SimulateOptions& o);
void declare_explain(Verb& verb, ExplainOptions& o);
void declare_calibrate(Verb& verb, CalibrateOptions& o);
void declare_study(Verb& verb, StudyOptions& o);
void declare_cohort(Verb& verb, CohortOptions& o);

}  // namespace tissuewarp::apps
