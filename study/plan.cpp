#include "study/plan.hpp"

#include <algorithm>
#include <tuple>

namespace tissuewarp::study {

namespace {

/// What is varied; the base's own values are among them or not.
struct Axes {
    std::vector<int> elements, gpu_elements;
    std::vector<double> tolerances;       ///< against all meshes
    std::vector<double> base_tolerances;  ///< on the base's mesh alone
    std::vector<Law> laws;
    std::vector<double> poissons_ratios;
    std::vector<Solver> solvers;
};

Axes axes_of(Extent extent, bool registration) {
    if (extent == Extent::Quick)
        return {registration ? std::vector{2500} : std::vector{1300, 16500},
                {1300},
                {1, 0.01},
                {},
                {Law::Linear},
                {},
                {Solver::Lbfgs, Solver::DynamicRelaxation, Solver::SelfCheckedRelaxation}};
    return {{5000, 10000, 20000, 50000, 100000, 200000, 500000},
            {20000, 50000, 100000, 200000, 500000, 1000000},
            {1, 0.1, 0.01},
            {0.3, 0.03, 0.003, 0.001},
            {Law::Linear, Law::Iso, Law::Stable, Law::MooneyRivlin, Law::Ogden},
            {0.3, 0.4, 0.45, 0.49, 0.495},
            {Solver::Lbfgs, Solver::DynamicRelaxation, Solver::SelfCheckedRelaxation, Solver::Newton}};
}

class Planner {
public:
    Planner(const Problem& problem, const PlanOptions& options)
        : problem_(problem), options_(options), base_(base_of(problem, options)) {}

    std::vector<Setting> run() {
        const Axes axes = axes_of(options_.extent, problem_.is_registration());
        add([](Setting&) {});
        for (const double tolerance : axes.base_tolerances) add([&](Setting& s) { s.tolerance_mm = tolerance; });
        std::vector<int> meshes = axes.elements;
        if (base_.processor == tled::Processor::Gpu)
            meshes.insert(meshes.end(), axes.gpu_elements.begin(), axes.gpu_elements.end());
        meshes.push_back(base_.elements);
        for (const int elements : meshes) {
            add([&](Setting& s) { s.elements = elements; });
            for (const double tolerance : axes.tolerances)
                add([&](Setting& s) {
                    s.elements = elements;
                    s.tolerance_mm = tolerance;
                });
        }
        for (const tled::Element element : every_element) add([&](Setting& s) { s.element = element; });
        for (const Law law : axes.laws) add([&](Setting& s) { s.physics.law = law; });
        for (const double ratio : axes.poissons_ratios) add([&](Setting& s) { s.physics.poissons_ratio = ratio; });
        for (const Hold hold : {Hold::Hard, Hold::Soft}) add([&](Setting& s) { s.physics.hold = hold; });
        for (const Solver solver : axes.solvers) add([&](Setting& s) { s.solver = solver; });
        add([](Setting& s) { s.arithmetic = tled::Scalar::Float64; });
        for (const tled::Processor processor : options_.processors) {
            if (processor == base_.processor) continue;
            const bool gpu = processor == tled::Processor::Gpu;
            for (const int elements : gpu ? axes.gpu_elements : axes.elements)
                add([&](Setting& s) {
                    s.processor = processor;
                    s.elements = elements;
                });
            add([&](Setting& s) { s.processor = processor; });
        }
        std::stable_sort(settings_.begin(), settings_.end(),
                         [](const Setting& a, const Setting& b) { return shared(a) < shared(b); });
        return settings_;
    }

private:
    static std::tuple<int, int, int, double, int> shared(const Setting& s) {
        return {s.elements, static_cast<int>(s.element), static_cast<int>(s.physics.law), s.physics.poissons_ratio,
                static_cast<int>(s.physics.hold)};
    }

    template <class Change>
    void add(const Change& change) {
        Setting setting = base_;
        change(setting);
        const bool gpu = setting.processor == tled::Processor::Gpu;
        const int most = gpu ? std::max(options_.most_elements, 1000000) : options_.most_elements;
        if (setting.elements > most || !problem_.refusal(setting).empty()) return;
        if (std::find(settings_.begin(), settings_.end(), setting) == settings_.end()) settings_.push_back(setting);
    }

    const Problem& problem_;
    const PlanOptions& options_;
    Setting base_;
    std::vector<Setting> settings_;
};

}  // namespace

Setting base_of(const Problem& problem, const PlanOptions& options) {
    Setting base = problem.base();
    if (options.extent == Extent::Quick) base.elements = 6000;
    base.processor = options.processors.front();
    return base;
}

std::vector<Setting> plan(const Problem& problem, const PlanOptions& options) {
    return Planner(problem, options).run();
}

std::string factor_of(const Setting& setting, const Setting& base) {
    std::vector<std::string> factors;
    if (setting.elements != base.elements) factors.emplace_back("elements");
    if (setting.tolerance_mm != base.tolerance_mm) factors.emplace_back("tolerance");
    if (setting.element != base.element) factors.emplace_back("element");
    if (setting.physics.law != base.physics.law) factors.emplace_back("law");
    if (setting.physics.poissons_ratio != base.physics.poissons_ratio) factors.emplace_back("Poisson's ratio");
    if (setting.physics.hold != base.physics.hold) factors.emplace_back("hold");
    if (setting.solver != base.solver) factors.emplace_back("solver");
    if (setting.arithmetic != base.arithmetic) factors.emplace_back("arithmetic");
    if (setting.processor != base.processor) {
        std::erase(factors, "elements");
        factors.emplace_back("processor");
    }
    if (factors.empty()) return "base";
    if (factors.size() == 1) return factors.front();
    return factors == std::vector<std::string>{"elements", "tolerance"} ? "elements and tolerance" : "several";
}

}  // namespace tissuewarp::study
