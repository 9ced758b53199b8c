#include "registration/detail/shipped_fronts.hpp"

namespace tissuewarp::registration::detail {

const char* const shipped_fronts_text = R"json({
 "alignment_labels": {
  "constant_s": 0.07171,
  "slope_s": 0.2405
 },
 "alignment_partial": {
  "constant_s": 0.03907,
  "slope_s": 0.0
 },
 "fields": {
  "constant_s": 0.0,
  "slope_s": 0.07255
 },
 "machine": "CPU float32, AVX3, 2 threads",
 "points": [
  {
   "data": "labels",
   "edges_per_organ": 6.0,
   "error_95_mm": 2.356,
   "error_mm": 1.215,
   "judging_s": 0.0,
   "preparation_s": 0.08698,
   "rounds_95_s": 0.02703,
   "rounds_s": 0.01478,
   "tetrahedra": 2140.0,
   "fields_s": 0.1567
  },
  {
   "data": "labels",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.451,
   "error_mm": 1.228,
   "judging_s": 0.0,
   "preparation_s": 0.1325,
   "rounds_95_s": 0.1015,
   "rounds_s": 0.04537,
   "tetrahedra": 4938.0,
   "fields_s": 0.1567
  },
  {
   "data": "labels",
   "edges_per_organ": 10.0,
   "error_95_mm": 2.453,
   "error_mm": 1.213,
   "judging_s": 0.0,
   "preparation_s": 0.2977,
   "rounds_95_s": 0.2587,
   "rounds_s": 0.1437,
   "tetrahedra": 9702.0,
   "fields_s": 0.1567
  },
  {
   "data": "labels",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.463,
   "error_mm": 1.233,
   "judging_s": 0.0,
   "preparation_s": 0.4425,
   "rounds_95_s": 0.4478,
   "rounds_s": 0.2354,
   "tetrahedra": 16610.0,
   "fields_s": 0.1567
  },
  {
   "data": "labels",
   "edges_per_organ": 15.0,
   "error_95_mm": 2.472,
   "error_mm": 1.236,
   "judging_s": 0.0,
   "preparation_s": 1.109,
   "rounds_95_s": 1.608,
   "rounds_s": 0.7748,
   "tetrahedra": 32240.0,
   "fields_s": 0.1567
  },
  {
   "data": "labels",
   "edges_per_organ": 18.0,
   "error_95_mm": 2.475,
   "error_mm": 1.246,
   "judging_s": 0.0,
   "preparation_s": 2.446,
   "rounds_95_s": 4.626,
   "rounds_s": 2.512,
   "tetrahedra": 56060.0,
   "fields_s": 0.1567
  },
  {
   "data": "labels",
   "edges_per_organ": 22.0,
   "error_95_mm": 2.479,
   "error_mm": 1.246,
   "judging_s": 0.0,
   "preparation_s": 7.196,
   "rounds_95_s": 9.924,
   "rounds_s": 5.744,
   "tetrahedra": 101900.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 6.0,
   "error_95_mm": 2.752,
   "error_mm": 1.542,
   "judging_s": 0.01219,
   "preparation_s": 0.08698,
   "rounds_95_s": 0.03349,
   "rounds_s": 0.0202,
   "tetrahedra": 2140.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.485,
   "error_mm": 1.466,
   "judging_s": 0.0415,
   "preparation_s": 0.1325,
   "rounds_95_s": 0.1035,
   "rounds_s": 0.05389,
   "tetrahedra": 4938.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 10.0,
   "error_95_mm": 2.352,
   "error_mm": 1.433,
   "judging_s": 0.1095,
   "preparation_s": 0.2977,
   "rounds_95_s": 0.1888,
   "rounds_s": 0.1315,
   "tetrahedra": 9702.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.295,
   "error_mm": 1.322,
   "judging_s": 0.2453,
   "preparation_s": 0.4425,
   "rounds_95_s": 0.4356,
   "rounds_s": 0.3526,
   "tetrahedra": 16610.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 15.0,
   "error_95_mm": 2.178,
   "error_mm": 1.391,
   "judging_s": 0.7422,
   "preparation_s": 1.109,
   "rounds_95_s": 1.664,
   "rounds_s": 1.062,
   "tetrahedra": 32240.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 18.0,
   "error_95_mm": 2.209,
   "error_mm": 1.355,
   "judging_s": 1.922,
   "preparation_s": 2.446,
   "rounds_95_s": 5.567,
   "rounds_s": 3.27,
   "tetrahedra": 56060.0,
   "fields_s": 0.1567
  },
  {
   "data": "partial",
   "edges_per_organ": 22.0,
   "error_95_mm": 2.19,
   "error_mm": 1.38,
   "judging_s": 5.825,
   "preparation_s": 7.196,
   "rounds_95_s": 15.99,
   "rounds_s": 10.6,
   "tetrahedra": 101900.0,
   "fields_s": 0.1567
  }
 ],
 "schema": "tissuewarp.fronts",
 "schema_version": 2,
 "warp": {
  "constant_s": 0.0001493,
  "slope_s": 0.01668
 }
}
)json";

}  // namespace tissuewarp::registration::detail
