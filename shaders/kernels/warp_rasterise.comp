// PORTION_LANES invocations per portion of a tetrahedron: find the voxels whose centres it holds and leave in each the
// lowest index of all that hold it, whatever the order of execution. A lane takes whole rows of voxels, of which it
// computes the two ends.
// Needs: index, warp, warp.element. The warp_clear pass has run.
//! define PORTION_LANES

layout(location = 0) uniform uint portion_count;

/// Element, which of its portions, how many it has: rows are dealt out to the portions in turn.
layout(std430, binding = BINDING_WARP_PORTIONS) readonly buffer WarpPortions { uvec4 portions[]; };
layout(std430, binding = BINDING_WARP_OWNER) buffer WarpOwner { uint owner[]; };

/// An element reaches this far (voxels) beyond its faces. Errors of float32 at a face stay below, for elements of up to
/// 100 voxels with angles above 5 degrees, so that no voxel is lost between two of them.
const float slack = 1e-4;

/// Moves first and last to where first + i step, the excess of one coordinate over its lower bound, is not negative.
void clip_row(float excess, float step, float start, inout float first, inout float last) {
    if (step > 0.0) {
        first = max(first, start + ceil(-excess / step));
    } else if (step < 0.0) {
        last = min(last, start + floor(-excess / step));
    } else if (excess < 0.0) {
        last = start - 1.0;
    }
}

void main() {
    uint index = invocation_index() / PORTION_LANES;
    uint lane = invocation_index() % PORTION_LANES;
    if (index >= portion_count) return;
    uvec4 portion = portions[index];
    uint element = portion.x;
    uvec4 nodes = warp_tetrahedron[element];
    BarycentricMap map = barycentric_map(nodes);
    if (map.volume == 0.0) return;

    vec3 p1 = deformed(nodes.y), p2 = deformed(nodes.z), p3 = deformed(nodes.w);
    vec3 limit = vec3(output_size.xyz) - 1.0;
    vec3 lower = max(ceil(min(min(map.corner, p1), min(p2, p3)) - slack), vec3(0.0));
    vec3 upper = min(floor(max(max(map.corner, p1), max(p2, p3)) + slack), limit);
    if (!(lower.x <= upper.x && lower.y <= upper.y && lower.z <= upper.z)) return;

    vec3 gradient_0 = -map.gradient_1 - map.gradient_2 - map.gradient_3;
    float bound_0 = 1.0 + slack * length(gradient_0);
    float bound_1 = slack * length(map.gradient_1);
    float bound_2 = slack * length(map.gradient_2);
    float bound_3 = slack * length(map.gradient_3);
    uint rows_y = uint(upper.y - lower.y) + 1u;
    uint rows = rows_y * (uint(upper.z - lower.z) + 1u);
    for (uint row = portion.y * PORTION_LANES + lane; row < rows; row += portion.z * PORTION_LANES) {
        vec3 start = lower + vec3(0.0, float(row % rows_y), float(row / rows_y));
        vec3 p = start - map.corner;
        float first = lower.x, last = upper.x;
        clip_row(dot(gradient_0, p) + bound_0, gradient_0.x, start.x, first, last);
        clip_row(dot(map.gradient_1, p) + bound_1, map.gradient_1.x, start.x, first, last);
        clip_row(dot(map.gradient_2, p) + bound_2, map.gradient_2.x, start.x, first, last);
        clip_row(dot(map.gradient_3, p) + bound_3, map.gradient_3.x, start.x, first, last);
        if (!(first <= last)) continue;
        uint offset = output_size.x * (uint(start.y) + output_size.y * uint(start.z));
        for (uint i = uint(first); i <= uint(last); ++i) atomicMin(owner[offset + i], element);
    }
}
