#pragma once
/// The verbs. Each throws the exceptions of core/errors.hpp.

#include "apps/options.hpp"

namespace tissuewarp::apps {

void run_register(const RegisterOptions& options);
void run_prepare(const PrepareModelOptions& options);
void run_update(const UpdatePatientOptions& options);
void run_serve(const ServeOptions& options);
void run_mesh(const MeshOptions& options);
void run_warp(const WarpOptions& options);
void run_convert(const ConvertOptions& options);
void run_compound(const CompoundOptions& options);
void run_evaluate(const EvaluateOptions& options);
void run_info(const InfoOptions& options);
void run_bench(const BenchOptions& options);
void run_simulate(const SimulateOptions& options);
void run_calibrate(const CalibrateOptions& options);
void run_explain(const ExplainOptions& options);
void run_study(const StudyOptions& options);
void run_cohort(const CohortOptions& options);

}  // namespace tissuewarp::apps
