#include "registration/detail/shipped_fronts.hpp"

namespace tissuewarp::registration::detail {

const char* const shipped_fronts_text = R"json({
 "alignment_labels": {
  "constant_s": 0.07339,
  "slope_s": 0.4294
 },
 "alignment_partial": {
  "constant_s": 0.04583,
  "slope_s": 0.0
 },
 "fields": {
  "constant_s": 0.0,
  "slope_s": 0.03783
 },
 "machine": "CPU float32, AVX3, 2 threads",
 "points": [
  {
   "data": "labels",
   "edges_per_organ": 6.0,
   "error_95_mm": 2.394,
   "error_mm": 1.232,
   "fields_s": 0.1589,
   "preparation_s": 0.1326,
   "rounds_95_s": 0.01705,
   "rounds_s": 0.01023,
   "tetrahedra": 2141.0
  },
  {
   "data": "labels",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.385,
   "error_mm": 1.288,
   "fields_s": 0.1711,
   "preparation_s": 0.1565,
   "rounds_95_s": 0.03166,
   "rounds_s": 0.02241,
   "tetrahedra": 4947.0
  },
  {
   "data": "labels",
   "edges_per_organ": 10.0,
   "error_95_mm": 2.386,
   "error_mm": 1.286,
   "fields_s": 0.192,
   "preparation_s": 0.2498,
   "rounds_95_s": 0.06543,
   "rounds_s": 0.0421,
   "tetrahedra": 9712.0
  },
  {
   "data": "labels",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.392,
   "error_mm": 1.295,
   "fields_s": 0.2007,
   "preparation_s": 0.4017,
   "rounds_95_s": 0.1083,
   "rounds_s": 0.0731,
   "tetrahedra": 16640.0
  },
  {
   "data": "labels",
   "edges_per_organ": 15.0,
   "error_95_mm": 2.399,
   "error_mm": 1.303,
   "fields_s": 0.2005,
   "preparation_s": 0.8082,
   "rounds_95_s": 0.2715,
   "rounds_s": 0.1592,
   "tetrahedra": 32270.0
  },
  {
   "data": "labels",
   "edges_per_organ": 18.0,
   "error_95_mm": 2.402,
   "error_mm": 1.302,
   "fields_s": 0.2479,
   "preparation_s": 1.364,
   "rounds_95_s": 0.5494,
   "rounds_s": 0.3271,
   "tetrahedra": 56060.0
  },
  {
   "data": "labels",
   "edges_per_organ": 22.0,
   "error_95_mm": 2.404,
   "error_mm": 1.305,
   "fields_s": 0.3179,
   "preparation_s": 2.412,
   "rounds_95_s": 1.031,
   "rounds_s": 0.7334,
   "tetrahedra": 102000.0
  },
  {
   "data": "partial",
   "edges_per_organ": 6.0,
   "error_95_mm": 2.762,
   "error_mm": 1.506,
   "fields_s": 0.1455,
   "preparation_s": 0.1326,
   "rounds_95_s": 0.04298,
   "rounds_s": 0.02781,
   "tetrahedra": 2141.0
  },
  {
   "data": "partial",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.466,
   "error_mm": 1.435,
   "fields_s": 0.1815,
   "preparation_s": 0.1565,
   "rounds_95_s": 0.11,
   "rounds_s": 0.07819,
   "tetrahedra": 4947.0
  },
  {
   "data": "partial",
   "edges_per_organ": 10.0,
   "error_95_mm": 2.335,
   "error_mm": 1.387,
   "fields_s": 0.1901,
   "preparation_s": 0.2498,
   "rounds_95_s": 0.2456,
   "rounds_s": 0.1791,
   "tetrahedra": 9712.0
  },
  {
   "data": "partial",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.283,
   "error_mm": 1.322,
   "fields_s": 0.1724,
   "preparation_s": 0.4017,
   "rounds_95_s": 0.5435,
   "rounds_s": 0.4412,
   "tetrahedra": 16640.0
  },
  {
   "data": "partial",
   "edges_per_organ": 15.0,
   "error_95_mm": 2.172,
   "error_mm": 1.351,
   "fields_s": 0.2031,
   "preparation_s": 0.8082,
   "rounds_95_s": 2.384,
   "rounds_s": 1.492,
   "tetrahedra": 32270.0
  },
  {
   "data": "partial",
   "edges_per_organ": 18.0,
   "error_95_mm": 2.198,
   "error_mm": 1.337,
   "fields_s": 0.2548,
   "preparation_s": 1.364,
   "rounds_95_s": 6.847,
   "rounds_s": 4.093,
   "tetrahedra": 56060.0
  },
  {
   "data": "partial",
   "edges_per_organ": 22.0,
   "error_95_mm": 2.177,
   "error_mm": 1.349,
   "fields_s": 0.3351,
   "preparation_s": 2.412,
   "rounds_95_s": 18.43,
   "rounds_s": 12.44,
   "tetrahedra": 102000.0
  }
 ],
 "schema": "tissuewarp.fronts",
 "schema_version": 3,
 "warp": {
  "constant_s": 5.706e-05,
  "slope_s": 0.02508
 }
}
)json";

}  // namespace tissuewarp::registration::detail
