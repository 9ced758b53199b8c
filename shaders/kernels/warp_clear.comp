// One invocation per voxel of the output: no tetrahedron holds it yet.
// Needs: index, warp.

layout(std430, binding = BINDING_WARP_OWNER) writeonly buffer WarpOwner { uint owner[]; };

void main() {
    uint offset = invocation_index();
    if (offset < voxel_count()) owner[offset] = NO_OWNER;
}
