// Vertex stage of every render pass: three vertices without attributes, a triangle whose clipped part is the whole
// target, so that each texel is one fragment.

void main() {
    gl_Position = vec4(4.0 * vec2(gl_VertexID & 1, gl_VertexID >> 1) - 1.0, 0.0, 1.0);
}
