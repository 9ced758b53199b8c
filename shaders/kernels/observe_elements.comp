// Finds the smallest J - 1 and its element (the first of equals): one partial result per workgroup, as observe_nodes.
// Elements whose J is not finite are left out; their displacements tell.
// Needs: index, bindings, numbers, element. To be dispatched with PARTIALS workgroups in one row.
//! define PARTIALS

struct ElementPartial {
    float volume_change;
    uint element;
};
layout(std430, binding = BINDING_PARTIAL) writeonly buffer Partial { ElementPartial partial[]; };

shared ElementPartial lane[WORKGROUP_SIZE];

ElementPartial smaller(ElementPartial a, ElementPartial b) {
    bool second = b.volume_change < a.volume_change ||
                  (b.volume_change == a.volume_change && b.element < a.element);
    return second ? b : a;
}

void main() {
    uint local = gl_LocalInvocationID.x;
    ElementPartial least = ElementPartial(uintBitsToFloat(0x7f7fffffu), 0xffffffffu);
    for (uint e = first_element + gl_WorkGroupID.x * WORKGROUP_SIZE + local; e < end_element;
         e += PARTIALS * WORKGROUP_SIZE) {
        float volume_change = deformation(displacement_gradient(e, rest_element(e))).volume_change;
        if (is_finite(volume_change)) least = smaller(least, ElementPartial(volume_change, e));
    }
    lane[local] = least;
    barrier();
    for (uint half_size = WORKGROUP_SIZE / 2u; half_size > 0u; half_size /= 2u) {
        if (local < half_size) lane[local] = smaller(lane[local], lane[local + half_size]);
        barrier();
    }
    if (local == 0u) partial[gl_WorkGroupID.x] = lane[0];
}
