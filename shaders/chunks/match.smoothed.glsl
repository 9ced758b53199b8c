// Gives: where a pass leaves six maps.
// Needs: match.

layout(std430, binding = BINDING_MATCH_SMOOTHED_0) writeonly buffer MatchSmoothed0 { float smoothed_0[]; };
layout(std430, binding = BINDING_MATCH_SMOOTHED_1) writeonly buffer MatchSmoothed1 { float smoothed_1[]; };
layout(std430, binding = BINDING_MATCH_SMOOTHED_2) writeonly buffer MatchSmoothed2 { float smoothed_2[]; };
layout(std430, binding = BINDING_MATCH_SMOOTHED_3) writeonly buffer MatchSmoothed3 { float smoothed_3[]; };
layout(std430, binding = BINDING_MATCH_SMOOTHED_4) writeonly buffer MatchSmoothed4 { float smoothed_4[]; };
layout(std430, binding = BINDING_MATCH_SMOOTHED_5) writeonly buffer MatchSmoothed5 { float smoothed_5[]; };

void leave(uint offset, vec3 first, vec3 last) {
    smoothed_0[offset] = first.x;
    smoothed_1[offset] = first.y;
    smoothed_2[offset] = first.z;
    smoothed_3[offset] = last.x;
    smoothed_4[offset] = last.y;
    smoothed_5[offset] = last.z;
}
