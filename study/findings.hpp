#pragma once
/// What the points of a problem say, in words and numbers.

#include "study/accuracy_time.hpp"

#include <string>
#include <vector>

namespace tissuewarp::study {

/// A setting beside the base.
struct Comparison {
    const Point* point = nullptr;
    std::string factor, value;  ///< "law", "linear"
    double error_ratio = 1;     ///< over the base's
    double time_ratio = 1;      ///< of the medians
    std::string verdict;        ///< "more accurate, slower", …; "does not pay" where nothing is gained
};

struct Findings {
    const Point* base = nullptr;
    const Point* best = nullptr;          ///< least error
    const Point* knee = nullptr;          ///< registrations: the quickest within 5 % of the least error
    std::vector<const Point*> solved;     ///< of this problem
    std::vector<const Point*> front;      ///< by rising time
    std::vector<Comparison> comparisons;  ///< one factor at a time, in the order of the factors
    std::vector<std::string> failures;
    std::vector<std::string> lines;  ///< for a terminal: what of the above matters most
};

/// Points of other problems are left aside. Everything is empty where nothing was solved; without the base's point,
/// comparisons are.
Findings findings_of(const ProblemSummary& problem, const std::vector<Point>& points);

/// "14 s", "0.14 s", "8 ms".
std::string seconds_text(double seconds);
/// "1.23", "0.041", "0.0012": three digits at most.
std::string mm_text(double millimetres);

}  // namespace tissuewarp::study
