//! define WORKGROUP_SIZE
// Gives: the shape of the workgroup and invocation_index(), which counts all invocations of a dispatch. Program::dispatch
// spreads long dispatches over rows of workgroups, so the index may run past what was asked: kernels test it.

layout(local_size_x = WORKGROUP_SIZE) in;

uint invocation_index() {
    return (gl_WorkGroupID.y * gl_NumWorkGroups.x + gl_WorkGroupID.x) * WORKGROUP_SIZE + gl_LocalInvocationID.x;
}
