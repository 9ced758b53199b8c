// Needs: warp. Gives: continued(offset), X - z of a voxel outside the mesh, mm, frame of the moving image, as the host
// left it; a block for each component, so that none is larger than an image.

layout(std430, binding = BINDING_WARP_CONTINUATION_X) readonly buffer WarpContinuationX { float continuation_x[]; };
layout(std430, binding = BINDING_WARP_CONTINUATION_Y) readonly buffer WarpContinuationY { float continuation_y[]; };
layout(std430, binding = BINDING_WARP_CONTINUATION_Z) readonly buffer WarpContinuationZ { float continuation_z[]; };

vec3 continued(uint offset) { return vec3(continuation_x[offset], continuation_y[offset], continuation_z[offset]); }
