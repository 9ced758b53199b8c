// One invocation per pressure node (a node and a label): writes q_a = M_a U'(J_a) (kPa) with J_a = Σ ¼ V_e J_e / V_a.
// Needs: index, bindings, numbers, a law with USES_SHEAR 0. The element_volume pass has run.

layout(location = 0) uniform uint first_pressure_node;
layout(location = 1) uniform uint end_pressure_node;
layout(location = 2) uniform uint pressure_node_count;

/// 1 / V_a (1/mm³) and M_a (kPa).
layout(std430, binding = BINDING_PRESSURE_REST) readonly buffer PressureRest { vec2 pressure_rest[]; };
/// pressure_node_count + 1 offsets, then the entries: elements.
layout(std430, binding = BINDING_PRESSURE_INCIDENCE) readonly buffer PressureIncidence { uint pressure_incidence[]; };
layout(std430, binding = BINDING_VOLUME_CHANGE) readonly buffer VolumeChange { float volume_change_share[]; };
layout(std430, binding = BINDING_PRESSURE) writeonly buffer Pressure { float pressure[]; };

void main() {
    uint a = first_pressure_node + invocation_index();
    if (a >= end_pressure_node) return;
    uint begin = pressure_node_count + 1u + pressure_incidence[a];
    uint end = pressure_node_count + 1u + pressure_incidence[a + 1u];
    float sum = 0.0;
    for (uint i = begin; i < end; ++i) sum += volume_change_share[pressure_incidence[i]];
    vec2 rest = pressure_rest[a];
    pressure[a] = rest.y * volumetric_derivative(sum * rest.x);
}
