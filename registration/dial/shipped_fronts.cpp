#include "registration/dial/shipped_fronts.hpp"

namespace tissuewarp::registration::detail {

const char* const shipped_fronts_text = R"json({
 "alignment_labels": {
  "constant_s": 0.0601,
  "slope_s": 0.3287
 },
 "alignment_partial": {
  "constant_s": 0.03847,
  "slope_s": 0.0
 },
 "fields": {
  "constant_s": 0.0,
  "slope_s": 0.0327
 },
 "machine": "CPU float32, AVX3, 2 threads",
 "points": [
  {
   "data": "labels",
   "edges_per_organ": 6.0,
   "error_95_mm": 2.394,
   "error_mm": 1.232,
   "fields_s": 0.135,
   "preparation_s": 0.09586,
   "rounds_95_s": 0.01423,
   "rounds_s": 0.008062,
   "tetrahedra": 2141.0
  },
  {
   "data": "labels",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.385,
   "error_mm": 1.288,
   "fields_s": 0.1257,
   "preparation_s": 0.1133,
   "rounds_95_s": 0.02676,
   "rounds_s": 0.01577,
   "tetrahedra": 4947.0
  },
  {
   "data": "labels",
   "edges_per_organ": 10.0,
   "error_95_mm": 2.386,
   "error_mm": 1.286,
   "fields_s": 0.1493,
   "preparation_s": 0.2045,
   "rounds_95_s": 0.05204,
   "rounds_s": 0.03516,
   "tetrahedra": 9712.0
  },
  {
   "data": "labels",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.392,
   "error_mm": 1.295,
   "fields_s": 0.158,
   "preparation_s": 0.3142,
   "rounds_95_s": 0.09718,
   "rounds_s": 0.0535,
   "tetrahedra": 16640.0
  },
  {
   "data": "labels",
   "edges_per_organ": 15.0,
   "error_95_mm": 2.399,
   "error_mm": 1.303,
   "fields_s": 0.1808,
   "preparation_s": 0.5935,
   "rounds_95_s": 0.2563,
   "rounds_s": 0.1259,
   "tetrahedra": 32270.0
  },
  {
   "data": "labels",
   "edges_per_organ": 18.0,
   "error_95_mm": 2.402,
   "error_mm": 1.302,
   "fields_s": 0.2241,
   "preparation_s": 1.042,
   "rounds_95_s": 0.4824,
   "rounds_s": 0.2573,
   "tetrahedra": 56060.0
  },
  {
   "data": "labels",
   "edges_per_organ": 22.0,
   "error_95_mm": 2.404,
   "error_mm": 1.305,
   "fields_s": 0.2694,
   "preparation_s": 1.71,
   "rounds_95_s": 0.9248,
   "rounds_s": 0.5899,
   "tetrahedra": 102000.0
  },
  {
   "data": "partial",
   "edges_per_organ": 6.0,
   "error_95_mm": 2.77,
   "error_mm": 1.503,
   "fields_s": 0.1323,
   "preparation_s": 0.09586,
   "rounds_95_s": 0.05742,
   "rounds_s": 0.03214,
   "tetrahedra": 2141.0
  },
  {
   "data": "partial",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.473,
   "error_mm": 1.427,
   "fields_s": 0.1224,
   "preparation_s": 0.1133,
   "rounds_95_s": 0.08763,
   "rounds_s": 0.05428,
   "tetrahedra": 4947.0
  },
  {
   "data": "partial",
   "edges_per_organ": 10.0,
   "error_95_mm": 2.337,
   "error_mm": 1.379,
   "fields_s": 0.1513,
   "preparation_s": 0.2045,
   "rounds_95_s": 0.2132,
   "rounds_s": 0.105,
   "tetrahedra": 9712.0
  },
  {
   "data": "partial",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.285,
   "error_mm": 1.315,
   "fields_s": 0.1664,
   "preparation_s": 0.3142,
   "rounds_95_s": 0.3535,
   "rounds_s": 0.1857,
   "tetrahedra": 16640.0
  },
  {
   "data": "partial",
   "edges_per_organ": 15.0,
   "error_95_mm": 2.172,
   "error_mm": 1.344,
   "fields_s": 0.1878,
   "preparation_s": 0.5935,
   "rounds_95_s": 0.6356,
   "rounds_s": 0.4411,
   "tetrahedra": 32270.0
  },
  {
   "data": "partial",
   "edges_per_organ": 18.0,
   "error_95_mm": 2.199,
   "error_mm": 1.333,
   "fields_s": 0.2202,
   "preparation_s": 1.042,
   "rounds_95_s": 1.265,
   "rounds_s": 0.9658,
   "tetrahedra": 56060.0
  },
  {
   "data": "partial",
   "edges_per_organ": 22.0,
   "error_95_mm": 2.179,
   "error_mm": 1.349,
   "fields_s": 0.2558,
   "preparation_s": 1.71,
   "rounds_95_s": 3.58,
   "rounds_s": 2.118,
   "tetrahedra": 102000.0
  }
 ],
 "schema": "tissuewarp.fronts",
 "schema_version": 3,
 "warp": {
  "constant_s": 1.916e-05,
  "slope_s": 0.01995
 }
}
)json";

}  // namespace tissuewarp::registration::detail
