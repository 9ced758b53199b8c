// Gives: six maps of patch distances, one for each pair of the octahedron, as they are read.
// Needs: match.

layout(std430, binding = BINDING_MATCH_DISTANCE_0) readonly buffer MatchDistance0 { float distance_0[]; };
layout(std430, binding = BINDING_MATCH_DISTANCE_1) readonly buffer MatchDistance1 { float distance_1[]; };
layout(std430, binding = BINDING_MATCH_DISTANCE_2) readonly buffer MatchDistance2 { float distance_2[]; };
layout(std430, binding = BINDING_MATCH_DISTANCE_3) readonly buffer MatchDistance3 { float distance_3[]; };
layout(std430, binding = BINDING_MATCH_DISTANCE_4) readonly buffer MatchDistance4 { float distance_4[]; };
layout(std430, binding = BINDING_MATCH_DISTANCE_5) readonly buffer MatchDistance5 { float distance_5[]; };

vec3 first_three(uint offset) { return vec3(distance_0[offset], distance_1[offset], distance_2[offset]); }
vec3 last_three(uint offset) { return vec3(distance_3[offset], distance_4[offset], distance_5[offset]); }
