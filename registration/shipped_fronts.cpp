#include "registration/detail/shipped_fronts.hpp"

namespace tissuewarp::registration::detail {

const char* const shipped_fronts_text = R"json({
 "alignment_labels": {
  "constant_s": 0.6925715865413102,
  "slope_s": 1.1705996845479487
 },
 "alignment_partial": {
  "constant_s": 0.2716120236,
  "slope_s": 0.0
 },
 "fields": {
  "constant_s": 0.9709806806751219,
  "slope_s": 0.2541833860482864
 },
 "machine": "CPU float32, AVX3, 2 threads",
 "points": [
  {
   "data": "labels",
   "edges_per_organ": 8.0,
   "error_95_mm": 0.9927940012210136,
   "error_mm": 0.9701538006383766,
   "judging_s": 0.0,
   "preparation_s": 1.014198001,
   "rounds_95_s": 0.6082810374,
   "rounds_s": 0.24920355900000005,
   "tetrahedra": 4956.0
  },
  {
   "data": "labels",
   "edges_per_organ": 12.0,
   "error_95_mm": 0.9627999429770862,
   "error_mm": 0.8713278353397487,
   "judging_s": 0.0,
   "preparation_s": 1.7833281315,
   "rounds_95_s": 3.48860626225,
   "rounds_s": 2.2135817095,
   "tetrahedra": 16583.0
  },
  {
   "data": "partial",
   "edges_per_organ": 8.0,
   "error_95_mm": 2.5913744240683307,
   "error_mm": 2.5586658278416796,
   "judging_s": 0.080401705,
   "preparation_s": 1.014198001,
   "rounds_95_s": 0.45178304849999995,
   "rounds_s": 0.206207091,
   "tetrahedra": 4956.0
  },
  {
   "data": "partial",
   "edges_per_organ": 12.0,
   "error_95_mm": 2.280873635613228,
   "error_mm": 1.4866769667252222,
   "judging_s": 0.515400596,
   "preparation_s": 1.7833281315,
   "rounds_95_s": 1.8821738377999997,
   "rounds_s": 1.324882685,
   "tetrahedra": 16583.0
  }
 ],
 "schema": "tissuewarp.fronts",
 "schema_version": 1,
 "warp": {
  "constant_s": 0.015088295670320474,
  "slope_s": 0.1050778719375809
 }
}
)json";

}  // namespace tissuewarp::registration::detail
